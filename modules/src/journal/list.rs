//! A journal in words.

use super::entry::{ENTRY_BYTES_MAX, Entries, NoEntry};
use super::event::EventAt;
use super::outputs::{KnownTypes, describe};
use super::tag::Tag;
use std::io::Read;

/// Tells all entries, up to where the journal ends, or cannot be read any further, or `tell` says false.
pub(super) fn each<R: Read>(mut entries: Entries<R>, mut tell: impl FnMut(&str) -> bool) {
    let mut events = 0_u64;
    loop {
        let text = match entries.look() {
            Ok(tag) => {
                events += u64::from(tag == Tag::Event);
                text(tag, entries.content(), events)
            }
            Err(NoEntry::End) => return,
            Err(damage) => {
                tell(&words(damage));
                return;
            }
        };
        if !tell(&text) {
            return;
        }
        entries.pass();
    }
}

fn words(damage: NoEntry) -> String {
    match damage {
        NoEntry::End | NoEntry::Cut => "(the journal is cut off within an entry)".into(),
        NoEntry::Sum => "(an entry is damaged or missing)".into(),
        NoEntry::Long(len) => format!("(an entry of {len} bytes, and {ENTRY_BYTES_MAX} are read)"),
        NoEntry::Tag(tag) => format!("(an entry of an unknown kind, {tag})"),
        NoEntry::Unreadable(kind) => format!("(its file cannot be read: {kind})"),
    }
}

fn text(tag: Tag, content: &[u8], number: u64) -> String {
    match (tag, postcard::from_bytes::<EventAt<'_>>(content)) {
        (Tag::Event, Ok(EventAt { at_ns, event })) => format!("{number} at {at_ns} ns: it {}", event.words()),
        (Tag::Hole, _) => {
            let why: &str = postcard::from_bytes(content).unwrap_or_default();
            format!("  it does what no journal sees: {why}")
        }
        _ => format!("  {}", describe(tag, content, None, &KnownTypes::default())),
    }
}
