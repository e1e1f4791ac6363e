//! What is recorded, and what is replicated, in words.

use super::Page;
use crate::output::Level;
use crate::record::{RecordedItems, Sampling};
use crate::units::{duration_text, size_about, size_text};
use rohrpost_network::{LINE_PART_BYTES, LINE_PART_HEADS_BYTES};
use std::time::Duration;

impl Page<'_> {
    pub(super) fn record(&mut self) {
        let Some(record) = &self.installation.record else { return };
        let recorder = self.installation.recorder();
        self.title("Recording");
        if let Some(module) = recorder {
            let (name, node) = (self.name(module.name), &module.node);
            let directory = record.directory.display();
            self.entry("by", &format!("{name}, on node {node}; its files are {directory}/{node}-0001.mcap and so on"));
        }
        let items = |page: &Self, all: &[RecordedItems], of_all: &str| {
            let texts: Vec<String> = all.iter().map(|items| page.recorded(items, of_all)).collect();
            if texts.is_empty() { "none".into() } else { texts.join("; ") }
        };
        self.entry("streams", &items(self, &record.streams, "all of all modules"));
        self.entry("data", &items(self, &record.data, "all of all modules, but streams"));
        let output = match record.output {
            None => "no lines".into(),
            Some(Level::Trace) => "all lines".into(),
            Some(level) => format!("lines of level {} and above", level.as_str()),
        };
        self.entry("output", &output);
        if let Some(rate_hz) = record.drawn {
            let drawn = format!("for other programs, at most {rate_hz} a second of each, beside what is recorded");
            self.entry("drawn", &drawn);
        }
        if !record.exact.is_empty() {
            let names: Vec<String> = record.exact.iter().map(|module| self.name(module.name)).collect();
            self.entry("exact", &format!("{}; each writes a journal, by which it can be replayed", names.join(", ")));
        }
        let (size, age) = (size_text(record.rotate_size), duration_text(record.rotate_after));
        let free = size_text(record.leave_free);
        self.entry("files", &format!("a new one after {size} or {age}; {free} of the disk stay free"));
        let control = match record.control {
            None => "`rohrpost record` alone".into(),
            Some(control) => format!("`rohrpost record`, and TCP at {control}"),
        };
        self.entry("controlled by", &control);
        if let Some(note) = record.control_note() {
            self.entry("security", &note);
        }
        let (flush, sync) = (duration_text(record.flush), duration_text(record.sync));
        self.entry("may lose", &format!("the last {flush} if it is killed, {sync} more if the power fails"));
    }

    pub(super) fn replicas(&mut self) {
        if self.installation.replicas.is_empty() {
            return;
        }
        self.title("Replicas");
        for replica in &self.installation.replicas {
            let node = self.installation.node_of(replica.from).unwrap_or_default();
            let asks = match replica.deadline {
                Duration::ZERO => "; what is lost is not asked for".into(),
                deadline => format!("; what is lost is asked for during {}", duration_text(deadline)),
            };
            let asks = self.installation.hop_by_lan(replica).map_or_else(String::new, |_| asks);
            let words = format!(
                "{} of node {node} to {}: {} of its records{}, each of at most {}; told if later than {}{asks}",
                replica.text(self.installation),
                replica.to.join(", "),
                replica.sampling,
                if replica.changed { ", if it has changed" } else { "" },
                size_text(replica.spec(self.installation).record_bytes.into()),
                duration_text(replica.delay_alarm)
            );
            self.entry("sends", &words);
            for (node, to) in self.installation.hops_by_tcp(replica) {
                let record_bytes = replica.spec(self.installation).record_bytes as usize;
                let parts = record_bytes.div_ceil(LINE_PART_BYTES).max(1);
                let bytes = record_bytes + parts * LINE_PART_HEADS_BYTES;
                let load = match replica.sampling {
                    Sampling::Rate(rate_hz) => {
                        format!("; up to {} a second to each", size_about((bytes as f64 * rate_hz) as u64))
                    }
                    Sampling::Each | Sampling::Every(_) => String::new(),
                };
                let words = format!(
                    "from {node} to {}, as fast as the line of each takes it: one record at a time, then the \
                     newest{load}",
                    to.join(", ")
                );
                self.entry("by TCP", &words);
            }
        }
    }

    /// `of_all`: what an entry without a name means.
    fn recorded(&self, items: &RecordedItems, of_all: &str) -> String {
        let what = match (items.from, items.item.is_some()) {
            (None, _) => of_all.into(),
            (Some(from), false) => format!("all of {}", self.name(from)),
            (Some(_), true) => items.text(&self.installation.classes),
        };
        match items.sampling {
            Sampling::Each => what,
            sampling => format!("{what} ({sampling})"),
        }
    }
}
