//! The parts of a graph: modules, and edges with their content; and the graph for Graphviz.

use crate::look::observer::Silence;
use crate::terminal::units::per_second;
use rohrpost::output::plain;
use rohrpost_launch::survey::Standing;
use serde::Serialize;
use std::fmt::Write;

/// Modules and the edges between them.
#[derive(Serialize)]
pub(super) struct Graph {
    pub(super) installation: String,
    /// The node that the tool runs on.
    pub(super) node: String,
    /// The nodes that are shown.
    pub(super) nodes: Vec<String>,
    /// The shown nodes that do not answer.
    pub(super) silent: Vec<Silence>,
    /// The window of the rates.
    pub(super) interval_s: f64,
    pub(super) modules: Vec<Module>,
    pub(super) edges: Vec<Edge>,
}

#[derive(Serialize)]
pub(super) struct Module {
    pub(super) module: String,
    pub(super) node: String,
    pub(super) aliases: Vec<String>,
    pub(super) state: String,
    pub(super) priority: u8,
    /// It need not run.
    #[serde(skip)]
    pub(super) is_left_out: bool,
}

impl Module {
    /// Whether no process of it is visible. Senders outside the configuration have no state.
    pub(super) fn is_down(&self) -> bool {
        let down = [Standing::Stopped, Standing::Unreachable];
        down.iter().any(|standing| standing.word() == self.state)
    }
}

/// The content of an edge.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[serde(rename_all = "lowercase")]
pub(super) enum Carries {
    Data,
    /// Records that a module reads where they were written.
    Stream,
    Command,
    /// A command that every module understands.
    Common,
    Reply,
    Output,
}

#[derive(Serialize)]
pub(super) struct Edge {
    pub(super) from: String,
    pub(super) to: String,
    pub(super) carries: Carries,
    pub(super) what: String,
    pub(super) packages: u64,
    pub(super) packages_per_s: f64,
    pub(super) bytes_per_s: f64,
    pub(super) refused: u64,
}

impl Graph {
    /// The nodes and edges of a drawing.
    pub(super) fn title(&self) -> String {
        let word = if self.nodes.len() == 1 { "node" } else { "nodes" };
        format!("{word} {} of {}", self.nodes.join(", "), self.installation)
    }

    /// The text below a module's name: its node if there are several, its aliases.
    pub(super) fn below<'a>(&'a self, module: &'a Module) -> impl Iterator<Item = String> + use<'a> {
        let node = (self.nodes.len() > 1).then(|| format!("on {}", module.node));
        node.into_iter().chain(module.aliases.iter().map(|alias| format!("+ {alias}")))
    }

    /// The edges that a drawing shows.
    pub(super) fn drawn(&self, all: bool) -> impl Iterator<Item = &Edge> {
        self.edges.iter().filter(move |edge| all || !matches!(edge.carries, Carries::Reply | Carries::Common))
    }
}

impl Edge {
    pub(super) fn add(&mut self, other: &Self) {
        self.packages += other.packages;
        self.packages_per_s += other.packages_per_s;
        self.bytes_per_s += other.bytes_per_s;
        self.refused += other.refused;
    }

    pub(super) fn label(&self) -> String {
        format!("{} {}", plain::line(&self.what), self.rate())
    }

    pub(super) fn rate(&self) -> String {
        per_second(self.packages_per_s)
    }
}

pub(super) fn to_dot(graph: &Graph, all: bool) -> String {
    let mut text = String::from("digraph rohrpost {\n");
    let _ = writeln!(text, "    label = {:?}", graph.title());
    text.push_str("    rankdir = LR\n    node [shape = box, style = rounded, fontname = \"sans-serif\"]\n");
    text.push_str("    edge [fontname = \"sans-serif\", fontsize = 10]\n");
    for module in &graph.modules {
        let below = graph.below(module).map(|line| format!("\\n{line}"));
        let dead = if module.is_down() { ", style = \"rounded,dashed\"" } else { "" };
        let _ = writeln!(
            text,
            "    {:?} [label = \"{}{}\"{dead}]",
            module.module,
            module.module,
            below.collect::<String>()
        );
    }
    for edge in graph.drawn(all) {
        let style = match edge.carries {
            Carries::Data => "",
            Carries::Stream => ", color = \"#2a6fb5\", style = bold",
            Carries::Command | Carries::Common => ", style = bold, color = \"#b5432a\"",
            Carries::Reply => ", style = dotted",
            Carries::Output => ", color = gray",
        };
        let label = edge.label();
        let _ = writeln!(text, "    {:?} -> {:?} [label = {label:?}{style}]", edge.from, edge.to);
    }
    text.push('}');
    text
}
