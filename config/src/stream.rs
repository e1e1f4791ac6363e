//! Sizes of a module's streams.

use crate::reader::{Item, Section};
use rohrpost_mailbox::{STREAM_KEEP_MAX, STREAM_READERS_MAX, StreamShape};
use std::collections::BTreeMap;
use std::time::Duration;

/// Largest record of a stream, bytes.
pub const RECORD_BYTES_MAX: u32 = 1 << 30;

/// One stream of a module. A stream that has no section in the file is the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamSpec {
    /// Largest record in bytes, 1..=[`RECORD_BYTES_MAX`].
    pub record_bytes: u32,
    /// Records that are kept, 2..=[`STREAM_KEEP_MAX`].
    pub keep: u32,
    /// Most readers at a time, 1..=[`STREAM_READERS_MAX`].
    pub readers: u16,
    /// How far behind the newest a stamp may be. Zero: a record that is behind is refused.
    pub late: Duration,
}

impl Default for StreamSpec {
    fn default() -> Self {
        Self { record_bytes: 4096, keep: 64, readers: 8, late: Duration::ZERO }
    }
}

impl StreamSpec {
    /// The shape that such a stream has in shared memory.
    pub const fn shape(&self) -> StreamShape {
        StreamShape { record_bytes: self.record_bytes, keep: self.keep, readers: self.readers, late: self.late }
    }

    /// Bytes of shared memory that it takes, all in all.
    pub fn memory(&self) -> u64 {
        self.shape().segment_bytes() as u64
    }

    /// The streams of a module, by the names of their items in its interfaces.
    pub(crate) fn read_all(section: Option<Section<'_>>, module: &str) -> BTreeMap<String, Self> {
        let entries = section.map(|section| section.entries()).unwrap_or_default();
        entries.iter().filter_map(|item| Some((name(item)?, Self::read(item, module)?))).collect()
    }

    /// Changes the keys of the section and keeps the rest.
    fn read(item: &Item<'_>, module: &str) -> Option<Self> {
        let section = item.section(&format!("{module}, stream `{}`", item.key))?;
        let mut spec = Self::default();
        let record = |item: &Item<'_>| item.size(1..=RECORD_BYTES_MAX.into(), "8 MiB");
        spec.record_bytes = section.or("record", spec.record_bytes.into(), record) as u32;
        spec.keep = section.whole_or("keep", 2..=STREAM_KEEP_MAX, spec.keep);
        spec.readers = section.whole_or("readers", 1..=STREAM_READERS_MAX as u16, spec.readers);
        spec.late = section.or("late", spec.late, late);
        section.finish();
        Some(spec)
    }
}

/// The name of a stream is that of a function in a trait.
fn name(item: &Item<'_>) -> Option<String> {
    let name = &item.key;
    let is_name = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !is_name {
        item.report(format!(
            "`{name}` is no name of a stream; write the name that follows `fn` in the interface: letters, digits and \
             `_`, no digit first"
        ));
    }
    is_name.then(|| name.clone())
}

fn late(item: &Item<'_>) -> Option<Duration> {
    if item.is("refuse") {
        return Some(Duration::ZERO);
    }
    let text = item.value.get_ref().as_str();
    if text.is_some_and(|text| text.starts_with(|c: char| c.is_ascii_digit())) {
        return item.duration_above_zero("50 ms");
    }
    item.wrong("\"refuse\", or how far a stamp may be behind the newest, such as `late = \"50 ms\"`")
}
