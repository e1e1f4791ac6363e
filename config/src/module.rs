//! Modules: what runs where, with which settings, and what happens when it ends.

use crate::calls::{CallLimits, Calls, DownwardCalls};
use crate::classes::TEAM_ROUTER;
use crate::directory::Directory;
use crate::mailbox::{MailboxLines, Mailboxes, TRANSIT, lines_at};
use crate::module_nodes::{self, Standby};
use crate::node::Node;
use crate::reader::{Item, Section, nearest};
use crate::restart::Restart;
use crate::stream::StreamSpec;
use crate::units::duration_text;
use crate::watchdog::Watchdog;
use rohrpost_mailbox::{Name, saturating_sum};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::time::Duration;

/// The built-in module that is a node's client of the TCP router.
pub const TCP_CLIENT: &str = "tcp-client";
/// The built-in module that is the server.
pub const TCP_ROUTER: &str = "tcp-router";
/// The built-in module that records.
pub const RECORDER: &str = "logd";
/// The built-in module that plays recordings.
pub const REPLAY: &str = "replay";
/// The modules that the `rohrpost` program itself contains.
pub const BUILTINS: [&str; 14] = [
    "sim", "carmen", "mapper", "pilot", "mischief", "wormhole", "team", "payload", "station", "arena", "body",
    "output", RECORDER, REPLAY,
];

/// What runs as a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Program {
    /// One of [`BUILTINS`], the router of a node, its client of the TCP router, or that router.
    Builtin(String),
    /// A program and its arguments.
    Command(Vec<String>),
}

/// Longest busy wait of a module for packages before it sleeps: after that none is likely to come soon.
pub const SPIN_MAX: Duration = Duration::from_millis(1);

/// See [`Module::ready_within`].
const READY_WITHIN: Duration = Duration::from_secs(10);

/// See [`Module::busy_after`].
pub(crate) const BUSY_AFTER: Duration = Duration::from_secs(1);

/// Whether a module works after launch, or waits to be switched on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Start {
    /// Works at once.
    #[default]
    On,
    /// Waits for the command `on`.
    Off,
}

/// One `[[module]]`.
#[derive(Clone, Debug)]
pub struct Module {
    /// Its name.
    pub name: Name,
    /// Further names that its process hosts.
    pub aliases: Vec<Name>,
    /// Node that it runs on; of several, the first choice, or the one that the installation is
    /// [seen from](crate::Installation::seen_from).
    pub node: String,
    /// Nodes that may run it, first choice first; mostly one.
    pub nodes: Vec<String>,
    /// Node that grants its lease, if the file says it.
    pub(crate) witness: Option<String>,
    /// How its other nodes stand by.
    pub standby: Standby,
    /// What runs.
    pub program: Program,
    /// Whether it is left out with a notice when its program does not exist.
    pub optional: bool,
    /// Whether its node does not start without it. Without an optional one the others run.
    pub required: bool,
    /// Modules and aliases it sends commands to; subscribing is a command too.
    pub calls: Vec<Name>,
    /// The members of [`calls`](Self::calls) that may have a less important class, and why.
    pub downwards: DownwardCalls,
    /// How long it waits at most for an answer, where [`calls`](Self::calls) says so.
    pub call_limits: CallLimits,
    /// Settings of its own; [`Document::settings_as`](crate::Document::settings_as) gives them a type.
    pub settings: toml::Table,
    /// State after launch.
    pub start: Start,
    /// What happens when it ends.
    pub restart: Restart,
    /// Time from start to ready, at most.
    pub ready_within: Duration,
    /// Time from being told to end until it is killed.
    pub stop_within: Duration,
    /// Code of it that runs for this long without a return is reported: the module is busy.
    pub busy_after: Duration,
    /// How long it may be silent before launch ends it; none: for ever.
    pub watchdog: Option<Watchdog>,
    /// Busy wait for packages before it sleeps.
    pub spin: Duration,
    /// Its mailboxes.
    pub mailboxes: Mailboxes,
    /// Its streams with a section in the file, by the names of their items. Any other stream of it is the default.
    pub streams: BTreeMap<String, StreamSpec>,
    /// Line of its `[[module]]` in the file.
    pub line: usize,
    /// The index of its `[[module]]` in the file, from 0; none for an implicit one.
    pub(crate) index: Option<usize>,
}

impl Module {
    /// Its name and the names of its aliases.
    pub fn names(&self) -> impl Iterator<Item = Name> {
        std::iter::once(self.name).chain(self.aliases.iter().copied())
    }

    /// Whether it is a `[[module]]` of the file. Routers are implicit when there are several nodes, and so are the
    /// modules of `[tcp]` and `[team]`.
    pub fn is_in_file(&self) -> bool {
        self.index.is_some()
    }

    pub(crate) fn is_recorder(&self) -> bool {
        self.program == Program::Builtin(RECORDER.into())
    }

    /// An implicit module, with the defaults of all of these.
    pub(crate) fn by_itself(name: Name, node: &Node, builtin: &str, restart: Restart) -> (Self, Lines) {
        let module = Self {
            name,
            aliases: Vec::new(),
            node: node.name.clone(),
            nodes: vec![node.name.clone()],
            witness: None,
            standby: Standby::default(),
            program: Program::Builtin(builtin.into()),
            optional: false,
            // A robot starts even if its certificates or its link beyond the LAN are missing.
            required: ![TCP_CLIENT, TCP_ROUTER, TEAM_ROUTER].contains(&builtin),
            calls: Vec::new(),
            downwards: DownwardCalls::default(),
            call_limits: CallLimits::default(),
            settings: toml::Table::new(),
            start: Start::On,
            restart,
            ready_within: READY_WITHIN,
            stop_within: crate::stopping::USUAL,
            busy_after: BUSY_AFTER,
            watchdog: None,
            spin: Duration::ZERO,
            mailboxes: Mailboxes::default(),
            streams: BTreeMap::new(),
            line: node.line,
            index: None,
        };
        (module, Lines { mailboxes: lines_at(node.line), calls: Vec::new(), alone: Vec::new() })
    }

    /// Whether it has a mailbox for packages that go elsewhere.
    pub fn has_transit(&self) -> bool {
        !self.is_in_file() && self.program != Program::Builtin(TCP_ROUTER.into())
    }

    /// Bytes of its mailboxes and of [`streams`](Self::streams).
    pub fn memory(&self) -> u64 {
        self.mailbox_memory().saturating_add(self.stream_memory())
    }

    /// Bytes of its mailboxes; each alias has a command mailbox like the module's.
    pub fn mailbox_memory(&self) -> u64 {
        let [commands, replies, data] = self.mailboxes.each().map(|(_, spec)| spec.memory());
        let transit = if self.has_transit() { TRANSIT.memory() } else { 0 };
        commands * (1 + self.aliases.len() as u64) + replies + data + transit
    }

    /// Bytes of [`streams`](Self::streams). Which further streams its interfaces have is not known here.
    pub fn stream_memory(&self) -> u64 {
        saturating_sum(self.streams.values().map(StreamSpec::memory))
    }
}

/// Lines at which parts of a module stand, for checks across modules.
pub(crate) struct Lines {
    pub(crate) mailboxes: MailboxLines,
    /// Line of each name in [`Module::calls`].
    pub(crate) calls: Vec<usize>,
    /// The names that it calls alone, with their line.
    pub(crate) alone: Vec<(Name, usize)>,
}

/// Context for the names that a module refers to.
pub(crate) struct Context<'d> {
    pub(crate) directory: &'d Directory<'d>,
    pub(crate) nodes: &'d [Node],
}

impl Context<'_> {
    /// Reads a module; none if a key without a default is missing. The reader has reported it then.
    pub(crate) fn read(&self, section: Section<'_>, index: usize) -> Option<(Module, Lines)> {
        let name_text = section.get("name").and_then(|item| item.value.get_ref().as_str());
        let what = name_text.map_or("[[module]]".into(), |name| format!("module `{name}`"));
        let section = section.called(&what);
        let name = name_text.and_then(|text| self.directory.find(text).ok());
        let aliases = section.get("aliases").map(|item| self.aliases(&item)).unwrap_or_default();
        let nodes = module_nodes::read(&section, &|item, name| self.is_known(item, name));
        let node = if nodes.is_empty() { self.node(&section) } else { nodes.first().cloned() };
        let witness = section.get("witness").and_then(|item| Some((item.text("base")?, item)));
        let witness = witness.filter(|(name, item)| self.is_known(item, name)).map(|(name, _)| name.into());
        let standby = &[("hot", Standby::Hot), ("cold", Standby::Cold)];
        let standby = section.or("standby", Standby::default(), |item| item.choice(standby));
        let program = program(&section);
        let optional = section.or("optional", false, Item::flag);
        let required = required(&section, optional);
        let calls = section.get("calls").map(|item| Calls::read(&item, self.directory, &what)).unwrap_or_default();
        let settings = settings(&section).unwrap_or_default();
        let start = section.or("start", Start::On, |item| item.choice(&[("on", Start::On), ("off", Start::Off)]));
        let restart = section.get("restart").map(|item| Restart::read(&item, &what)).unwrap_or_default();
        let ready_within = section.or("ready-within", READY_WITHIN, |item| item.duration_above_zero("10 s"));
        let stop_within = section.get("stop-within").and_then(|item| item.duration_above_zero("2 s"));
        let busy_after = section.or("busy-after", BUSY_AFTER, |item| item.duration_above_zero("1 s"));
        let watchdog = Watchdog::read(&section, &calls);
        let spin = section.or("spin", Duration::ZERO, spin);
        let boxes = section.section("mailbox", &format!("{what}, mailbox"));
        let (mailboxes, mailbox_lines) = Mailboxes::read(boxes, &what, section.line);
        let streams = StreamSpec::read_all(section.section("stream", &format!("{what}, stream")), &what);
        let line = section.line;
        section.finish();
        let program = program?;
        let is_recorder = program == Program::Builtin(RECORDER.into());
        let module = Module {
            name: name?,
            aliases,
            nodes: if nodes.is_empty() { node.iter().cloned().collect() } else { nodes },
            node: node?,
            witness,
            standby,
            stop_within: stop_within.unwrap_or(crate::stopping::usual(is_recorder)),
            program,
            optional,
            required,
            calls: calls.names,
            downwards: calls.downwards,
            call_limits: calls.limits,
            settings,
            start,
            restart,
            ready_within,
            busy_after,
            watchdog,
            spin,
            mailboxes,
            streams,
            line,
            index: Some(index),
        };
        Some((module, Lines { mailboxes: mailbox_lines, calls: calls.lines, alone: calls.alone }))
    }

    /// The directory has read and validated the texts already.
    fn aliases(&self, item: &Item<'_>) -> Vec<Name> {
        let texts = item.value.get_ref().as_array().into_iter().flatten().filter_map(|alias| alias.get_ref().as_str());
        texts.filter_map(|text| self.directory.find(text).ok()).collect()
    }

    fn node(&self, section: &Section<'_>) -> Option<String> {
        let names = || self.nodes.iter().map(|node| node.name.as_str());
        let Some(item) = section.get("node") else {
            return match self.nodes {
                [only] => Some(only.name.clone()),
                [] => None,
                _ => {
                    let names = names().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
                    let right = format!("write `node = ` and one of {names}");
                    section.report(format!("`node` is missing, and there are several; {right}"));
                    None
                }
            };
        };
        let name = item.text("main").filter(|name| self.is_known(&item, name))?;
        Some(name.into())
    }

    /// Whether there is this node; if not, that is reported.
    fn is_known(&self, item: &Item<'_>, name: &str) -> bool {
        let names = || self.nodes.iter().map(|node| node.name.as_str());
        if names().any(|known| known == name) {
            return true;
        }
        let right = match nearest(name, names()) {
            Some(known) => format!("did you mean `{known}`? Otherwise add `[nodes.{name}]`"),
            None => format!("the nodes are {}; or add `[nodes.{name}]`", names().collect::<Vec<_>>().join(", ")),
        };
        item.report(format!("there is no node `{name}`; {right}"));
        false
    }
}

fn program(section: &Section<'_>) -> Option<Program> {
    match (section.get("builtin"), section.get("program")) {
        (Some(item), None) => {
            let text = item.text("sim")?;
            if BUILTINS.contains(&text) {
                return Some(Program::Builtin(text.into()));
            }
            let right = match nearest(text, BUILTINS) {
                Some(name) => format!("did you mean `{name}`?"),
                None => format!("there are {}; a program of your own goes into `program`", BUILTINS.join(", ")),
            };
            item.report(format!("there is no builtin `{text}`; {right}"));
            None
        }
        (None, Some(item)) => command(&item).map(Program::Command),
        (Some(_), Some(item)) => {
            item.report("`builtin` and `program` are both given; a module runs as one of them, drop the other");
            None
        }
        (None, None) => {
            section
                .report("neither `builtin` nor `program` is given; write what runs, such as `program = \"./compass\"`");
            None
        }
    }
}

fn command(item: &Item<'_>) -> Option<Vec<String>> {
    let example = "[\"./compass\", \"--port\", \"/dev/ttyS0\"]";
    if let Some(text) = item.value.get_ref().as_str() {
        // No shell parses it, so quotes need no escapes.
        if text.trim().is_empty() || text.contains(char::is_whitespace) {
            item.report(format!(
                "`program` \"{text}\" is no single program; write program and arguments as a list, `program = \
                 {example}`"
            ));
            return None;
        }
        return Some(vec![text.into()]);
    }
    let words = item.list(example)?;
    let words: Option<Vec<String>> = words.iter().map(|word| Some(word.value.get_ref().as_str()?.into())).collect();
    let words = words.filter(|words| words.first().is_some_and(|program| !program.is_empty()));
    if words.is_none() {
        item.report(format!("`program` is a list of texts, the program first; write `program = {example}`"));
    }
    words
}

fn required(section: &Section<'_>, optional: bool) -> bool {
    let Some(item) = section.get("required") else { return false };
    let required = item.flag().unwrap_or(false);
    if required && optional {
        item.report(
            "`required` and `optional` are both true; a module without which the node does not start cannot be left \
             out, drop one of them",
        );
    }
    required
}

fn spin(item: &Item<'_>) -> Option<Duration> {
    let spin = item.duration("20 us")?;
    if spin <= SPIN_MAX {
        return Some(spin);
    }
    let (spin, most) = (duration_text(spin), duration_text(SPIN_MAX));
    item.report(format!(
        "`spin` is \"{spin}\"; write at most \"{most}\", such as `spin = \"20 us\"`: it keeps a processor busy all \
         that time"
    ));
    None
}

fn settings(section: &Section<'_>) -> Option<toml::Table> {
    let item = section.get("settings")?;
    item.section("")?;
    let settings = toml::Table::deserialize(toml::de::ValueDeserializer::from(item.value.clone()));
    let wrong = |error: &toml::de::Error| {
        let line = error.span().map_or(item.line, |span| item.reader.line(span));
        item.reader.report(line, format!("{}: settings: {}", section.what, error.message()));
    };
    settings.inspect_err(wrong).ok()
}
