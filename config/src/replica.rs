//! Replicas: streams of a node that other nodes read as if they were written there, `[[replica]]`.

use crate::directory::Directory;
use crate::node::Node;
use crate::reader::{Item, Section, nearest};
use crate::record::{RecordedItems, Sampling};
use rohrpost_mailbox::Name;
use std::time::Duration;

/// Most replicas of an installation.
pub const REPLICAS_MAX: usize = 64;
/// A picture of a few hundred kilobytes takes about as long on a wire of 1 Gbit/s.
const DELAY_ALARM: Duration = Duration::from_millis(5);
/// Some round trips of a bad radio, or cycles of time slots; and what is older is of little use to a robot.
const DEADLINE: Duration = Duration::from_millis(200);

/// One `[[replica]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Replica {
    /// Module or alias that writes the stream.
    pub from: Name,
    /// The stream's name in its interface.
    pub item: String,
    /// Nodes that have a replica, each once.
    pub to: Vec<String>,
    /// Which of its records are sent.
    pub sampling: Sampling,
    /// Of these, only those with other bytes than the last one that was sent.
    pub changed: bool,
    /// A record that arrives later than this after it was written is told.
    pub delay_alarm: Duration,
    /// Lost parts of a record are asked for until nothing came of it for so long; zero: never.
    pub deadline: Duration,
    /// Line in the file.
    pub line: usize,
}

impl Replica {
    pub(crate) fn read(section: Section<'_>, directory: &Directory<'_>, nodes: &[Node]) -> Option<Self> {
        let stream = section.required("stream", "stream = \"camera.0/image\"");
        let stream = stream.and_then(|item| {
            if !item.is_table() {
                item.text("camera.0/image")?;
            }
            let read = RecordedItems::read(&item, "[[replica]]", directory)?;
            let (Some(from), Some(name)) = (read.from, read.item) else {
                item.report("a replica is of one stream; write it as `stream = \"camera.0/image\"`");
                return None;
            };
            Some((from, name, read.sampling))
        });
        let to = section.required("to", "to = [\"brain\"]");
        let to = to.and_then(|item| {
            if item.list("[\"brain\"]")?.is_empty() {
                item.report("`to` names no node; write for example `to = [\"brain\"]`, or drop the replica");
            }
            Some(destinations(&section, &item.texts("brain"), nodes))
        });
        let changed = section.or("changed", false, Item::flag);
        let delay_alarm = section.or("delay-alarm", DELAY_ALARM, |item| item.duration_above_zero("5 ms"));
        let deadline = section.or("deadline", DEADLINE, |item| item.duration("200 ms"));
        let line = section.line;
        section.finish();
        let ((from, item, sampling), to) = (stream?, to?);
        Some(Self { from, item, to, sampling, changed, delay_alarm, deadline, line })
    }

    /// Whether a node has by it the one stream that an entry of the recorder names.
    pub(crate) fn is_of(&self, items: &RecordedItems, node: &str) -> bool {
        let is_it = items.item.as_ref().is_some_and(|item| *item == self.item);
        is_it && items.from == Some(self.from) && self.to.iter().any(|to| to == node)
    }
}

/// The nodes of `to`; what is wrong with one is reported.
fn destinations(section: &Section<'_>, named: &[(&str, usize)], nodes: &[Node]) -> Vec<String> {
    let report = |line: usize, text: String| section.reader.report(line, format!("[[replica]]: {text}"));
    let mut to: Vec<String> = Vec::new();
    for (text, line) in named {
        match nodes.iter().find(|node| node.name == *text) {
            None => {
                let like = nearest(text, nodes.iter().map(|node| node.name.as_str()));
                let like = like.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
                report(*line, format!("`{text}` is no node of [nodes]{like}"));
            }
            Some(_) if to.iter().any(|known| known == text) => {
                report(*line, format!("node {text} is named twice; drop one"));
            }
            Some(_) => to.push((*text).to_owned()),
        }
    }
    to
}
