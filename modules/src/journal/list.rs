//! A journal in words.

use super::entry::{self, NoEntry, Tag};
use super::event::EventAt;
use super::outputs::{KnownTypes, describe};

/// All entries, up to where the journal ends, or cannot be read any further.
pub(super) fn entries(bytes: &[u8]) -> Vec<String> {
    let (mut at, mut sum, mut events, mut entries) = (0, 0, 0_u64, Vec::new());
    loop {
        let entry = match entry::read(bytes, at, sum) {
            Ok(entry) => entry,
            Err(NoEntry::End) => return entries,
            Err(damage) => {
                entries.push(words(damage));
                return entries;
            }
        };
        (at, sum) = (entry.content.end, entry.sum);
        events += u64::from(entry.tag == Tag::Event);
        entries.push(text(entry.tag, &bytes[entry.content], events));
    }
}

fn words(damage: NoEntry) -> String {
    match damage {
        NoEntry::End | NoEntry::Cut => "(the journal is cut off within an entry)".into(),
        NoEntry::Sum => "(an entry is damaged or missing)".into(),
        NoEntry::Tag(tag) => format!("(an entry of an unknown kind, {tag})"),
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
