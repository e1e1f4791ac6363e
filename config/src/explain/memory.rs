//! Words for what modules keep in shared memory.

use crate::OverflowPolicy;
use crate::mailbox::MailboxSpec;
use crate::module::Module;
use crate::stream::StreamSpec;
use crate::units::{count_text, duration_text, size_text};
use rohrpost_mailbox::saturating_sum;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What all modules of a node keep there, and `others` besides, each with its name.
pub(super) fn of_node(modules: &[&Module], others: [(u64, &str); 2]) -> String {
    let sum = |memory: fn(&Module) -> u64| saturating_sum(modules.iter().map(|module| memory(module)));
    let mut words = format!("{} of mailboxes", about(sum(Module::mailbox_memory)));
    for (bytes, what) in [(sum(Module::stream_memory), "streams")].into_iter().chain(others) {
        if bytes > 0 {
            let _ = write!(words, ", {} of {what}", about(bytes));
        }
    }
    words
}

pub(super) fn mailbox(spec: &MailboxSpec) -> String {
    let full = match spec.full {
        OverflowPolicy::Displace => "full: the least important gives way",
        OverflowPolicy::Latest => "latest: the newer replaces the older",
        OverflowPolicy::Reject => "full: new ones are refused",
    };
    let mut words = format!("{} {full}", places(spec.slots.into(), spec.size, spec.memory()));
    if let Some(age) = spec.max_age {
        let _ = write!(words, "; stale after {}", duration_text(age));
    }
    if spec.claims > 1 {
        let _ = write!(words, "; {} claims a sender", spec.claims);
    }
    words
}

/// A line for each stream, with the names below each other.
pub(super) fn streams(streams: &BTreeMap<String, StreamSpec>) -> Vec<String> {
    let width = streams.keys().map(String::len).max().unwrap_or(0);
    let line = |(name, spec): (&String, &StreamSpec)| {
        let late = match spec.late.is_zero() {
            true => "a record behind the newest is refused".into(),
            false => format!("a record may be {} behind the newest", duration_text(spec.late)),
        };
        let (places, readers) =
            (places(spec.keep, spec.record_bytes, spec.memory()), count_text(spec.readers.into(), "reader"));
        format!("{name:width$}  {places} {readers}; {late}")
    };
    streams.iter().map(line).collect()
}

/// How many of which size, and the memory of all.
fn places(number: u32, size: u32, memory: u64) -> String {
    let (size, memory) = (size_text(size.into()), about(memory));
    format!("{number:>4} x {size:<7} = {memory:<9}")
}

/// A size in at most four digits.
fn about(bytes: u64) -> String {
    if bytes < 10 << 20 {
        format!("{} KiB", bytes.div_ceil(1 << 10))
    } else {
        format!("{} MiB", bytes.div_ceil(1 << 20))
    }
}
