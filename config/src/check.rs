//! Rules across modules.

mod access;
mod replica;

use crate::calls::Downwards;
use crate::flow::Flow;
use crate::installation::Installation;
use crate::module::{Lines, Module};
use crate::reader::Reader;
use crate::standby;
use crate::tdma::{self, TdmaLines};
use crate::units::{duration_text, size_text};
use rohrpost_mailbox::Name;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Tools that may be inside a module's command mailbox at the same time.
const TOOLS: usize = 2;

/// Largest rate of a flow, bytes a second: a larger one is a mistaken unit.
const FLOW_BYTES_MAX: u64 = 1 << 30;

/// Validates rules that concern more than one module; `lines` are those of the modules, `slots` those of the time
/// slots.
pub(crate) fn across(installation: &Installation, lines: &[Lines], slots: Option<&TdmaLines>, reader: &Reader<'_>) {
    claims(installation, lines, reader);
    for (module, lines) in installation.modules.iter().zip(lines) {
        access::validate(installation, module, lines, reader);
        for (to, line) in module.calls.iter().zip(&lines.calls) {
            importance(installation, module, *to, *line, reader);
        }
    }
    for flow in &installation.flows {
        self::flow(installation, flow, lines, reader);
    }
    carried_twice(installation, reader);
    replica::validate(installation, reader);
    standby::validate(installation, reader);
    // Consequences of other mistakes are not reported.
    if let Some(slots) = slots.filter(|_| reader.is_content()) {
        tdma::validate(installation, slots, reader);
    }
}

/// A module that waits for a less important one also waits for all that runs before that one.
fn importance(installation: &Installation, module: &Module, to: Name, line: usize, reader: &Reader<'_>) {
    let classes = &installation.classes;
    // The kernel and the mailboxes know the class of the process, not of an alias.
    let host = match installation.module(to) {
        Some(host) => host.name,
        // Classes are the same in all systems.
        None if to.system() != installation.system.id => to,
        None => return,
    };
    let (own, other) = (module.name.class(), host.class());
    let why = module.downwards.why(to);
    let (name, called) = (classes.format(module.name), classes.format(to));
    if other < own && why.is_none() {
        let in_process =
            if host == to { String::new() } else { format!(" (in the process of `{}`)", classes.format(host)) };
        reader.report(
            line,
            format!(
                "module `{name}`, of priority {}, calls `{called}`, of priority {}{in_process}: it would wait for \
                 something that all others go before; give one of them another class, or say why it may: \
                 `{{ to = \"{called}\", although = \"…\" }}`, or with `subscribes = true` that it only subscribes, \
                 which waits for nobody",
                own.0, other.0
            ),
        );
    }
    if other >= own && matches!(why, Some(Downwards::Although(_))) {
        reader.report(
            line,
            format!(
                "module `{name}`: `although` for `{called}` excuses nothing, since its priority {} is not below {}; \
                 write \"{called}\" alone",
                other.0, own.0
            ),
        );
    }
}

/// A flow must be possible: between two processes of which one calls the other, and into a mailbox that holds it.
fn flow(installation: &Installation, flow: &Flow, lines: &[Lines], reader: &Reader<'_>) {
    let (Some(from), Some(to)) = (installation.module(flow.from), installation.module(flow.to)) else { return };
    let (from_text, to_text) = (installation.classes.format(flow.from), installation.classes.format(flow.to));
    let what = format!("[[flow]] from `{from_text}` to `{to_text}`");
    if from.name == to.name {
        reader.report(flow.line, format!("{what}: both are the process of one module; drop the flow"));
        return;
    }
    let bytes_a_second = u128::from(flow.size) * 1_000_000_000 / flow.period.as_nanos().max(1);
    if bytes_a_second > u128::from(FLOW_BYTES_MAX) {
        reader.report(
            flow.line,
            format!(
                "{what}: {} each {} are more than {} a second, which no module can send; write a longer `period`",
                size_text(flow.size.into()),
                duration_text(flow.period),
                size_text(FLOW_BYTES_MAX)
            ),
        );
    }
    // Subscribed data comes into `data`, a command into `commands`. If each calls the other, it may be either.
    let ways = [(calls(from, to), 0), (calls(to, from), 2)];
    let mut boxes =
        ways.iter().filter(|(way, _)| *way).map(|(_, index)| (to.mailboxes.each()[*index], *index)).peekable();
    if boxes.peek().is_none() {
        reader.report(
            flow.line,
            format!(
                "{what}: neither calls the other, so nothing passes; add \"{from_text}\" to `calls` of the module \
                 that has `{to_text}` if it subscribes, \"{to_text}\" to `calls` of the other if it sends commands"
            ),
        );
        return;
    }
    let largest = boxes.max_by_key(|((_, spec), _)| spec.size);
    if let Some(((key, spec), index)) = largest.filter(|((_, spec), _)| spec.size < flow.size) {
        let line = installation.modules.iter().zip(lines).find(|(module, _)| module.name == to.name);
        reader.report(
            line.map_or(flow.line, |(_, lines)| lines.mailboxes[index].size),
            format!(
                "module `{}`, mailbox `{key}` holds bodies of {}, and the flow from `{from_text}` in line {} sends \
                 {}; write at least `size = \"{}\"`",
                installation.classes.format(to.name),
                size_text(spec.size.into()),
                flow.line,
                size_text(flow.size.into()),
                size_text(flow.size.into())
            ),
        );
    }
}

/// Each flow between two modules carries something else: a package belongs to one of them.
fn carried_twice(installation: &Installation, reader: &Reader<'_>) {
    let mut lines = BTreeMap::new();
    for flow in &installation.flows {
        let Some(carries) = flow.carries else { continue };
        match lines.entry((flow.from.raw(), flow.to.raw(), carries)) {
            Entry::Vacant(place) => _ = place.insert(flow.line),
            Entry::Occupied(first) => {
                let name = |name| installation.classes.format(name);
                let (from, to, line) = (name(flow.from), name(flow.to), first.get());
                reader.report(
                    flow.line,
                    format!(
                        "[[flow]] from `{from}` to `{to}`: the flow in line {line} carries `{carries}` already; \
                         let each carry something else, or make one of them"
                    ),
                );
            }
        }
    }
}

/// Each mailbox has more slots than its participants may hold unfinished: else stopped senders block it.
fn claims(installation: &Installation, lines: &[Lines], reader: &Reader<'_>) {
    for (module, lines) in installation.modules.iter().zip(lines) {
        let mut callers = Senders::of(installation, module, |other| calls(other, module));
        // Tools on other nodes call every module, through the router.
        callers.router |= installation.router_of(&module.node).is_some() && module.is_in_file();
        let mut called = Senders::of(installation, module, |other| calls(module, other));
        // Modules beyond the LAN may call every module, and be called by each.
        let beyond = installation.tcp.is_some() && module.is_in_file();
        (callers.beyond, called.beyond) = (beyond, beyond);
        let team = installation.team_router_of(&module.node).is_some() && module.is_in_file();
        (callers.team, called.team) = (team, team);
        for ((key, spec), line) in module.mailboxes.each().into_iter().zip(lines.mailboxes) {
            let (senders, tools) = if key == "commands" { (&callers, TOOLS) } else { (&called, 0) };
            let claims = (senders.count() + tools) * usize::from(spec.claims);
            if usize::from(spec.slots) <= claims {
                reader.report(
                    line.slots,
                    format!(
                        "module `{}`, mailbox `{key}`: {} may hold {claims} unfinished at once, so that \
                         `slots = {}` could be closed by senders that stopped midway; write at least `slots = {}`{}",
                        installation.classes.format(module.name),
                        senders.text(tools),
                        spec.slots,
                        claims + 1,
                        if spec.claims > 1 { ", or fewer `claims`" } else { "" }
                    ),
                );
            }
        }
    }
}

fn calls(caller: &Module, called: &Module) -> bool {
    called.names().any(|name| caller.calls.contains(&name))
}

/// Processes that write into a module's mailboxes: those on its node, and its router for all on others.
struct Senders {
    local: usize,
    router: bool,
    /// The client of the TCP router, for all beyond the LAN.
    beyond: bool,
    /// The router of the team, for other systems.
    team: bool,
}

impl Senders {
    fn of(installation: &Installation, module: &Module, sends: impl Fn(&Module) -> bool) -> Self {
        let senders = || installation.modules.iter().filter(|other| other.name != module.name && sends(other));
        Self {
            local: senders().filter(|other| other.nodes.iter().any(|node| module.nodes.contains(node))).count(),
            router: installation.router_of(&module.node).is_some()
                && senders().any(|other| {
                    let mut elsewhere = other.nodes.iter().filter(|node| module.nodes.iter().any(|own| own != *node));
                    elsewhere.any(|node| installation.lan_index(node).is_some())
                }),
            beyond: false,
            team: false,
        }
    }

    fn count(&self) -> usize {
        self.local + usize::from(self.router) + usize::from(self.beyond) + usize::from(self.team)
    }

    fn text(&self, tools: usize) -> String {
        let modules = match self.local {
            0 => None,
            1 => Some("1 module".into()),
            local => Some(format!("{local} modules")),
        };
        let router = self.router.then(|| String::from("the router"));
        let tools = (tools > 0).then(|| format!("{tools} tools"));
        let beyond = self.beyond.then(|| String::from("the client of the TCP router"));
        let team = self.team.then(|| String::from("the router of the team"));
        modules.into_iter().chain(router).chain(beyond).chain(team).chain(tools).collect::<Vec<_>>().join(" + ")
    }
}
