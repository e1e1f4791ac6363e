//! The key `nodes` of a module: several nodes, first choice first.

use crate::reader::{Item, Section};

/// Most nodes of a module.
pub const NODES_OF_MODULE_MAX: usize = 8;

/// How a module's other nodes stand by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Standby {
    /// The module's process is there, made up to its first call, off, and its mailboxes are found by nobody.
    #[default]
    Hot,
    /// There is no process before its node runs it.
    Cold,
}

/// Reads `nodes`; empty if there is no such key.
pub(crate) fn read(section: &Section<'_>, known: &dyn Fn(&Item<'_>, &str) -> bool) -> Vec<String> {
    let Some(item) = section.get("nodes") else { return Vec::new() };
    if section.get("node").is_some() {
        item.report("`node` and `nodes` are both given; a module with several nodes has `nodes` alone, drop `node`");
    }
    let mut nodes: Vec<String> = Vec::new();
    for entry in item.list("[\"brain\", \"desk\"]").unwrap_or_default() {
        let Some(name) = entry.text("brain").filter(|name| known(&entry, name)) else { continue };
        if nodes.iter().any(|earlier| earlier == name) {
            entry.report(format!("node `{name}` is named twice; drop one of them"));
            continue;
        }
        nodes.push(name.into());
    }
    if !(2..=NODES_OF_MODULE_MAX).contains(&nodes.len()) {
        item.report(format!(
            "`nodes` names two to {NODES_OF_MODULE_MAX} nodes, first choice first; for one write `node = `"
        ));
    }
    nodes
}
