//! The graph for Graphviz.

use super::parts::{Carries, Graph};
use std::fmt::Write;

pub(super) fn write(graph: &Graph, all: bool) -> String {
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
