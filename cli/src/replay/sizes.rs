//! Sizes of the player's streams. It has one section for all streams of one name of an item, whatever module they are
//! played for.

use crate::terminal::Failure;
use rohrpost_config::StreamSpec;

/// Memory for the records of one stream, those that readers hold with them.
const KEPT_BYTES: usize = 32 << 20;
/// Of records that are longer than fits into that, so many are kept, for so many readers.
const KEEP_MIN: usize = 2;
const READERS_MIN: usize = 2;
/// Several programs may publish on one topic, each with its own stamps.
const LATE: std::time::Duration = std::time::Duration::from_secs(10);

/// A stream of messages of another program, of so many bytes at most.
pub(super) fn of_records(record_bytes: u32) -> StreamSpec {
    let default = StreamSpec::default();
    // One frame is for each record that is kept, one for each reader, and one is being written.
    let frames = KEPT_BYTES / (record_bytes as usize).max(1);
    let readers = (frames / 2).clamp(READERS_MIN, default.readers.into());
    let keep = frames.saturating_sub(readers + 1).clamp(KEEP_MIN, default.keep as usize);
    StreamSpec { record_bytes, keep: keep as u32, readers: readers as u16, late: LATE }
}

/// What is asked of the streams of one name.
#[derive(Default)]
pub(super) struct ItemSizes {
    configured: Option<StreamSpec>,
    derived: Option<StreamSpec>,
}

impl ItemSizes {
    /// One that has a section, or the sizes of one without.
    pub(super) fn add_configured(&mut self, spec: StreamSpec) {
        let all = self.configured.get_or_insert(spec);
        all.record_bytes = all.record_bytes.max(spec.record_bytes);
        all.keep = all.keep.max(spec.keep);
        all.readers = all.readers.max(spec.readers);
        all.late = all.late.max(spec.late);
    }

    /// One with messages that are measured. All have room for the longest ones, and keep as many as fit of those.
    pub(super) fn add_derived(&mut self, spec: StreamSpec) {
        let record_bytes = self.derived.map_or(0, |all| all.record_bytes).max(spec.record_bytes);
        self.derived = Some(of_records(record_bytes));
    }

    /// For all of them. What is configured holds.
    pub(super) fn spec(&self, item: &str) -> Result<StreamSpec, Failure> {
        match (self.configured, self.derived) {
            (Some(configured), Some(derived)) if derived.record_bytes > configured.record_bytes => Err(format!(
                "streams called `{item}` share their sizes: the configuration has records of {} bytes for one, and \
                 messages of another take {}; name the other one differently (--into), or have `record` of \
                 [module.stream.{item}] be as much",
                configured.record_bytes, derived.record_bytes
            )
            .into()),
            (Some(configured), derived) => {
                let late = derived.map_or(configured.late, |derived| derived.late.max(configured.late));
                Ok(StreamSpec { late, ..configured })
            }
            (None, derived) => Ok(derived.unwrap_or_default()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(spec: &StreamSpec) -> u32 {
        spec.keep + u32::from(spec.readers) + 1
    }

    #[test]
    fn a_stream_has_room_for_the_longest_message_and_fewer_frames_of_long_ones() {
        for (record_bytes, wanted) in
            [(5, 73), (1_005, 73), ((1 << 20) + 5, 31), (3_000_000, 11), ((8 << 20) + 5, 5), ((16 << 20) + 5, 5)]
        {
            let spec = of_records(record_bytes);
            assert_eq!((spec.record_bytes, frames(&spec)), (record_bytes, wanted), "{record_bytes}");
            let bytes = spec.memory();
            assert!(frames(&spec) == 5 || bytes <= (KEPT_BYTES + (1 << 16)) as u64, "{record_bytes}: {bytes}");
        }
    }

    #[test]
    fn streams_of_one_name_have_the_longest_record_and_the_frames_of_that() {
        let mut all = ItemSizes::default();
        all.add_derived(of_records(10));
        all.add_derived(of_records(16 << 20));
        all.add_derived(of_records(100));
        assert_eq!(all.spec("image").unwrap(), of_records(16 << 20));
        let mut all = ItemSizes::default();
        let configured = StreamSpec { record_bytes: 100, keep: 7, readers: 3, late: LATE };
        all.add_configured(configured);
        all.add_derived(of_records(100));
        assert_eq!(all.spec("image").unwrap(), configured, "it holds");
        all.add_derived(of_records(101));
        let told = all.spec("image").unwrap_err().to_string();
        assert!(told.contains("records of 100 bytes for one, and messages of another take 101"), "{told}");
    }
}
