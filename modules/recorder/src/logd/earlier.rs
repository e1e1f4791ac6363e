//! What an earlier process of the recorder has recorded last. A stream goes on behind that: nothing of it is recorded
//! twice, and what its ring keeps no more is counted.

use super::leftovers::files;
use rohrpost_mailbox::{Participant, RecordInfo, Stamp, StreamId, StreamReader};
use rohrpost_recording::{LastMessage, last_message};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// So many files are looked into for a stream: it may be that nothing of it came for a while.
const FILES_MAX: usize = 32;

/// Files of the recorder's node that were there when it started.
pub(super) struct EarlierFiles {
    /// The one that was written last comes first.
    newest_first: Vec<PathBuf>,
}

impl EarlierFiles {
    /// Of a stem, in this folder and those below it.
    pub(super) fn find(directory: &Path, stem: &str) -> Self {
        let mut all = files(directory, stem);
        let written = |file: &PathBuf| file.metadata().and_then(|its| its.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
        // Of those that were written at the same time, the last of their numbers.
        all.sort_by_cached_key(written);
        all.reverse();
        Self { newest_first: all }
    }

    /// The sequence of the first record of a stream that is not in a file, if its topic has one there; the stream need
    /// not keep it any more. None also if the files are of another run: then records differ.
    pub(super) fn behind(&self, topic: &str, participant: &Arc<Participant>, id: StreamId) -> Option<u64> {
        let newest = participant.node().inspect_stream(id).ok().flatten()?.newest?;
        let mut reader = participant.stream_reader(id).ok()?;
        // What was written before the node began is of other streams.
        let begun = participant.node().path().metadata().and_then(|its| its.created()).ok();
        let is_of_it = |file: &&PathBuf| {
            let written = file.metadata().and_then(|its| its.modified()).ok();
            begun.zip(written).is_none_or(|(begun, written)| begun <= written)
        };
        // What cannot be read says nothing: better twice than missing.
        let files = self.newest_first.iter().filter(is_of_it).take(FILES_MAX);
        let mut last = files.filter_map(|file| last_message(file, topic).ok().flatten());
        last.find_map(|last| behind(&mut reader, &newest, &last))
    }
}

/// The sequence behind this message, if it is a record that the stream still keeps, or may be one that it kept.
fn behind(reader: &mut StreamReader, newest: &RecordInfo, last: &LastMessage) -> Option<u64> {
    // A recording has 32 bits of it.
    let back = (newest.sequence as u32).wrapping_sub(last.sequence);
    let sequence = newest.sequence.checked_sub(back.into())?;
    let LastMessage { epoch, stamp_ns: ns, ref data, .. } = *last;
    let stamp = Stamp { epoch, ns };
    let is_it = match reader.record(sequence) {
        Some(record) => record.info().stamp == stamp && record.body() == data,
        None => stamp <= newest.stamp,
    };
    is_it.then_some(sequence + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::Type;
    use rohrpost_mailbox::{Name, Node, StreamShape, StreamWriter};
    use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};
    use std::collections::BTreeMap;

    const ID: StreamId = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
    const KEEP: u64 = 8;

    /// A node with a stream that keeps eight records, and a folder.
    struct Place {
        folder: tempfile::TempDir,
        stream: StreamWriter,
        me: Arc<Participant>,
    }

    impl Place {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
            let shape = StreamShape { record_bytes: 8, keep: KEEP as u32, ..StreamShape::default() };
            let stream = Participant::join(&node, ID.name).unwrap().stream_writer(ID, shape).unwrap();
            let me = Participant::join(&node, Name::new(1, 24, 0, 0)).unwrap();
            Self { folder, stream, me }
        }

        /// The stream has these records.
        fn write(&mut self, numbers: std::ops::Range<u64>) {
            for number in numbers {
                let written = self.stream.write(Stamp { epoch: 1, ns: stamp_ns(number) }, &number.to_le_bytes());
                assert_eq!(written.unwrap(), number);
            }
        }

        /// A further file has them.
        fn record(
            &self,
            item: &str,
            numbers: std::ops::Range<u64>,
            stamp_ns: impl Fn(u64) -> u64,
            bytes: impl Fn(u64) -> u64,
        ) {
            let options = Options { leave_bytes: 0, ..Options::new(self.folder.path(), "base") };
            let mut writer = Writer::start(options, Session::default()).unwrap();
            let spec = ChannelSpec { name: "camera.0", item, ty: &Type::U64, texts: BTreeMap::new() };
            let channel = writer.channel(&spec).unwrap();
            for number in numbers {
                let (stamp_ns, data) = (stamp_ns(number), bytes(number).to_le_bytes());
                let message = Message { arrival_ns: number, stamp_ns, epoch: 1, sequence: number as u32, data: &data };
                writer.write(channel, &message).unwrap();
            }
            writer.finish().1.unwrap();
        }

        fn behind(&self) -> Option<u64> {
            EarlierFiles::find(self.folder.path(), "base").behind("camera.0/image", &self.me, ID)
        }
    }

    fn stamp_ns(number: u64) -> u64 {
        1_000 + number * 10
    }

    #[test]
    fn a_stream_goes_on_behind_the_last_record_that_is_in_a_file() {
        let mut place = Place::new();
        assert_eq!(place.behind(), None, "nothing is there");
        place.record("image", 0..3, stamp_ns, |number| number);
        assert_eq!(place.behind(), None, "the stream has no record yet");
        place.write(0..5);
        assert_eq!(place.behind(), Some(3));
        place.record("image", 3..5, stamp_ns, |number| number);
        assert_eq!(place.behind(), Some(5), "a later file has more");
        place.record("image", 3..5, |number| stamp_ns(number) + 1, |number| number);
        assert_eq!(place.behind(), Some(5), "a later file is of another run");
        place.record("other", 0..1, stamp_ns, |number| number);
        assert_eq!(place.behind(), Some(5), "the newest file has none of it");
        place.write(5..4 + KEEP);
        assert_eq!(place.behind(), Some(5), "it is the oldest that is kept");
        place.write(4 + KEEP..8 + KEEP);
        assert_eq!(place.behind(), Some(5), "it is kept no more: those between are lost, and to be counted");
        let other = |number: u64| stamp_ns(number) + 1_000_000;
        place.record("image", 3..5, other, |number| number);
        assert_eq!(place.behind(), Some(5), "a later file is of another run: its records are newer than the stream's");
    }

    #[test]
    fn records_of_another_run_are_not_taken_for_those_of_this_one() {
        for (numbers, is_other_stamp, is_other_value, why) in [
            (0..3, true, false, "of another time"),
            (0..3, false, true, "another value"),
            (0..100, false, false, "more than this stream ever had"),
        ] {
            let mut place = Place::new();
            place.write(0..5);
            place.record(
                "image",
                numbers,
                |number| stamp_ns(number) + u64::from(is_other_stamp),
                |number| number + u64::from(is_other_value),
            );
            assert_eq!(place.behind(), None, "{why}");
        }
    }
}
