//! Explains an installation in words: the page that `rohrpost check` prints, readable at 100 columns.

mod access;
mod memory;
mod record;
mod slots;
mod timeline;
mod ways;

use crate::calls::Downwards;
use crate::classes::TEAM_ROUTER;
use crate::installation::Installation;
use crate::mailbox::TRANSIT;
use crate::module::{BUSY_AFTER, Module, Program, Start, TCP_CLIENT, TCP_ROUTER};
use crate::node::{Node, Reach};
use crate::output::LineFormat;
use crate::saved::{SavedDocument, SavedValue};
use crate::time::{ClockSetPolicy, TimeSource};
use crate::units::{count_text, duration_text, size_text};
use rohrpost_mailbox::{Name, saturating_sum};
use rohrpost_network::LEVEL_NOT_REAL_TIME;
use std::fmt::Write;
use std::time::Duration;

const COLUMNS: usize = 100;
/// Where the right-hand sides under a module begin.
const INDENT: usize = 16;

/// Explains an installation, or one node of it: what runs where, how urgent it is, what its mailboxes and streams hold,
/// what happens when a mailbox is full, and when a module ends.
pub fn explain(installation: &Installation, node: Option<&str>) -> String {
    let mut page = Page {
        installation,
        saved: installation.saved.as_ref().map(|saved| saved.document(installation)),
        text: String::new(),
    };
    page.head();
    page.classes();
    for shown in installation.nodes.iter().filter(|shown| node.is_none_or(|name| name == shown.name)) {
        page.node(shown);
    }
    if let Some(name) = node.filter(|name| installation.node(name).is_none()) {
        let nodes: Vec<&str> = installation.nodes.iter().map(|node| node.name.as_str()).collect();
        page.line("");
        page.line(format!("There is no node `{name}`; the nodes are {}.", nodes.join(", ")));
    }
    page.slots();
    page.output();
    page.record();
    page.gui();
    page.flows();
    page.replicas();
    page.at_worst();
    page.replicas_in_slots();
    page.text
}

struct Page<'i> {
    installation: &'i Installation,
    saved: Option<SavedDocument<'i>>,
    text: String,
}

impl Page<'_> {
    fn line(&mut self, line: impl AsRef<str>) {
        self.text.push_str(line.as_ref().trim_end());
        self.text.push('\n');
    }

    /// What the lines below are about.
    fn title(&mut self, title: impl AsRef<str>) {
        self.line("");
        self.line(title);
        self.line("");
    }

    /// A label and words, with wrapped lines below each other.
    fn entry(&mut self, label: &str, words: &str) {
        let mut line = format!("  {label:<width$}", width = INDENT - 2);
        let mut first = true;
        for word in words.split(' ') {
            if !first && line.chars().count() + 1 + word.chars().count() > COLUMNS {
                self.line(&line);
                line = " ".repeat(INDENT);
                first = true;
            }
            if !first {
                line.push(' ');
            }
            line.push_str(word);
            first = false;
        }
        self.line(line);
    }

    fn name(&self, name: Name) -> String {
        self.installation.classes.format(name)
    }

    fn names(&self, names: impl IntoIterator<Item = Name>) -> String {
        let names: Vec<String> = names.into_iter().map(|name| self.name(name)).collect();
        if names.is_empty() { "nobody".into() } else { names.join(", ") }
    }

    fn head(&mut self) {
        let Installation { name, path, system, time, .. } = self.installation;
        self.line(format!("Installation `{name}` ({})", path.display()));
        self.line("");
        self.verdict();
        self.entry("system", &format!("{} `{}`: the first byte of its mailbox names", system.id, system.name));
        let time = match time {
            TimeSource::Local => "the computer's clock".into(),
            TimeSource::Master { masters, interval } => self.masters(masters, *interval),
            TimeSource::Simulation { speed } if *speed == 1.0 => "the simulation, as fast as real time".into(),
            TimeSource::Simulation { speed } => format!("the simulation, {speed} times as fast as real time"),
            TimeSource::Log => "the log that is replayed".into(),
        };
        self.entry("time", &time);
        if self.installation.when_set == ClockSetPolicy::NewEpoch {
            self.entry("clock set", "by a day or more: a new epoch of time begins at the computer's clock");
        }
        if let Some(file) = &self.installation.parameters {
            let words = format!("values saved in {} go before settings", file.display());
            self.entry("parameters", &words);
        }
        self.network();
        self.tcp();
        self.team();
        self.entry("digest", &format!("{} (equal on every node, or the files differ)", self.installation.digest()));
    }

    /// The nodes that may be master of time.
    fn masters(&self, masters: &[u8], interval: Duration) -> String {
        let mut names = masters.iter().filter_map(|index| self.installation.nodes.get(usize::from(*index)));
        let first = names.next().map_or("", |node| &node.name);
        let next: Vec<&str> = names.map(|node| node.name.as_str()).collect();
        let next = match &next[..] {
            [] => "no other node may follow it".into(),
            names => format!("if it is silent, that of {}", names.join(", then ")),
        };
        format!("the clock of node {first}, the master; {next}; told every {}", duration_text(interval))
    }

    fn classes(&mut self) {
        let classes = &self.installation.classes;
        let width = classes.iter().map(|entry| entry.name.len()).max().unwrap_or(0).max(5);
        // Where there is no network, nothing waits for it.
        let network = self.installation.network;
        let level = |priority| match network.map(|network| network.level(priority)) {
            None => String::new(),
            Some(LEVEL_NOT_REAL_TIME) => "  last ".into(),
            Some(level) => format!("  {level:>5}"),
        };
        let level_head = if network.is_some() { "  level" } else { "" };
        self.title("Classes. The id is the priority of all that a class sends; higher goes first, everywhere.");
        self.line(format!("  {:>3}{level_head}  {:width$}  {:13}  does", "id", "class", "runs as"));
        for entry in classes.iter() {
            let scheduling = self.installation.scheduling(entry.class);
            let (id, level) = (entry.class.0, level(entry.class.priority()));
            self.line(format!("  {id:>3}{level}  {:width$}  {scheduling:13}  {}", entry.name, entry.text));
        }
        self.line("");
        self.line("SCHED_FIFO: real time, a higher number runs first. nice: not real time, a higher number gives way.");
        if network.is_some() {
            self.line("level: its place among the packages that wait in a router, 0 goes first; last: not real time.");
        }
        self.line("Modules are started in the order below, and stopped in reverse.");
    }

    fn node(&mut self, node: &Node) {
        let modules: Vec<&Module> = self.installation.modules_on(&node.name).collect();
        let others = [
            (saturating_sum(self.installation.replica_memory_on(&node.name)), "replicas"),
            (self.installation.journals_on(&node.name), "journals"),
        ];
        let memory = memory::of_node(&modules, others);
        let number = count_text(modules.len(), "module");
        self.title(format!("Node `{}`: {number}, {memory}", node.name));
        if let Some(address) = &node.address {
            self.entry("address", &address.to_string());
        }
        if node.reach == Reach::Tcp {
            let words = "none on the LAN: packages to and from it, and its time, go through the TCP router";
            self.entry("network", words);
        }
        self.entry("access", &format!("mode {:04o} of the shared-memory directory", node.mode));
        let (hand, launch) = (node.tools_by_hand(), node.launch_instance());
        let (first, last) = (hand.start(), hand.end());
        self.entry("tools", &format!("launch is tool.{launch}; programs run by hand are tool.{first} to tool.{last}"));
        let standby = self.installation.stands_by(&node.name);
        if !standby.is_empty() {
            self.entry("stands by", &format!("for {}", self.names(standby)));
        }
        for module in modules {
            self.module(module);
        }
    }

    fn module(&mut self, module: &Module) {
        let class = module.name.class();
        self.line("");
        let (name, scheduling) = (self.name(module.name), self.installation.scheduling_of(module));
        self.line(format!("{name}  priority {}, {scheduling}", class.0));
        if !module.aliases.is_empty() {
            self.entry("is also", &self.names(module.aliases.iter().copied()));
        }
        self.entry("runs", &runs(module));
        self.installation.standby_text(module).iter().for_each(|words| self.entry("nodes", words));
        self.entry("starts", &starts(module));
        self.entry("when it ends", &module.restart.to_string());
        let subscribes = |name: &Name| module.downwards.subscribes(*name);
        let (subscribed, called): (Vec<Name>, Vec<Name>) = module.calls.iter().partition(|name| subscribes(name));
        self.entry("calls", &self.names(called));
        if !subscribed.is_empty() {
            self.entry("subscribes", &self.names(subscribed));
        }
        for to in &module.calls {
            if let Some(Downwards::Although(why)) = module.downwards.why(*to) {
                self.entry("although", &format!("{} is less important: {why}", self.name(*to)));
            }
            if let Some(limit) = module.call_limits.of(*to) {
                self.entry("waits", &format!("for {} at most {}", self.name(*to), duration_text(limit)));
            }
        }
        self.elsewhere(module);
        let callers =
            self.installation.modules.iter().filter(|other| module.names().any(|own| other.calls.contains(&own)));
        self.entry("called by", &self.names(callers.map(|caller| caller.name)));
        self.access(module);
        if !module.settings.is_empty() {
            let settings: Vec<String> = module.settings.iter().map(|(key, value)| format!("{key} = {value}")).collect();
            self.entry("settings", &settings.join(", "));
        }
        let saved = self.saved.as_ref().map(|saved| saved.texts(module.name)).unwrap_or_default();
        if !saved.is_empty() {
            let text = |saved: &SavedValue<&str>| format!("{} = {}", saved.name, saved.value);
            self.entry("saved", &saved.iter().map(text).collect::<Vec<_>>().join(", "));
        }
        for (key, spec) in module.mailboxes.each() {
            self.entry(key, &memory::mailbox(spec));
        }
        if module.has_transit() {
            self.entry("transit", &memory::mailbox(&TRANSIT));
        }
        for (index, words) in memory::streams(&module.streams).iter().enumerate() {
            self.entry(if index == 0 { "streams" } else { "" }, words);
        }
    }

    fn output(&mut self) {
        let output = &self.installation.output;
        self.title("Output");
        let mut words =
            format!("lines of level {} and above; the last {} are kept", output.level.as_str(), output.ring);
        for (module, level) in &output.levels {
            let _ = write!(words, "; {} from {}", self.name(*module), level.as_str());
        }
        self.entry("keeps", &words);
        let (rate, burst) = (output.rate, output.burst);
        let words = format!("{rate} lines a second from each module, {burst} at once; errors are counted apart");
        self.entry("takes", &words);
        if let Some(file) = &output.file {
            let format = match output.format {
                LineFormat::Text => "text",
                LineFormat::Json => "JSON",
            };
            let size = size_text(output.file_size);
            let kept = count_text(output.files as usize, "full file");
            self.entry("writes", &format!("{} as {format}; a new one after {size}, {kept} kept", file.display()));
        }
        if output.journal {
            self.entry("", "the system's journal");
        }
    }

    fn gui(&mut self) {
        let show = &self.installation.gui.show;
        if show.is_empty() {
            return;
        }
        self.title("GUI");
        for show in show {
            let rate = match show.rate {
                Some(rate) if rate > 0.0 => format!("at most {rate} a second"),
                Some(_) => "each that comes".into(),
                None => "as often as its view wants".into(),
            };
            let data = show.data.as_deref().unwrap_or("all that has a view");
            self.entry("shows", &format!("{data} of {}, {rate}", self.name(show.from)));
        }
    }

    fn flows(&mut self) {
        let flows = &self.installation.flows;
        if flows.is_empty() {
            return;
        }
        self.title("Flows");
        for flow in flows {
            let words = format!(
                "{} to {}: {}{} every {}, there within {}",
                self.name(flow.from),
                self.name(flow.to),
                flow.carries.map(|carries| format!("{carries}, ")).unwrap_or_default(),
                size_text(flow.size.into()),
                duration_text(flow.period),
                duration_text(flow.deadline)
            );
            self.entry("plans", &words);
        }
    }
}

fn runs(module: &Module) -> String {
    let what = match &module.program {
        Program::Builtin(name) if !module.is_in_file() => {
            let what = match name.as_str() {
                TCP_CLIENT => "this node's client of the TCP router",
                TCP_ROUTER => "the TCP router",
                TEAM_ROUTER => "this node's router of [team]",
                _ => "the router of this node",
            };
            return format!("{what}, there by itself");
        }
        Program::Builtin(name) => format!("builtin `{name}`"),
        Program::Command(words) => format!("program `{}`", words.join(" ")),
    };
    if module.optional { format!("{what}; left out with a notice, if there is no such program") } else { what }
}

fn starts(module: &Module) -> String {
    let state = match module.start {
        Start::On => "on",
        Start::Off => "off, until it is switched on",
    };
    let (ready, stop) = (duration_text(module.ready_within), duration_text(module.stop_within));
    let mut words = format!("{state}; must be ready within {ready}, has {stop} to stop");
    // Implicit modules have no such key.
    if module.required && module.is_in_file() {
        words.push_str("; without it the node does not start");
    }
    if module.busy_after != BUSY_AFTER {
        let _ = write!(words, "; busy after {}", duration_text(module.busy_after));
    }
    if let Some(watchdog) = module.watchdog {
        let _ = write!(words, "; {watchdog}");
    }
    if !module.spin.is_zero() {
        let _ = write!(words, "; spins for {}", duration_text(module.spin));
    }
    words
}
