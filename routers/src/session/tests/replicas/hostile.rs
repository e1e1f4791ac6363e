//! Parts that nobody should send: refused, counted by cause, and nothing else is disturbed.

use crate::frame::{DescriptionPart, RecordPart};
use crate::replication::{LINE_PART_BYTES, ReplicaLoss};
use crate::session::frame::SessionMessage;
use crate::session::tests::ground::Ground;
use crate::session::tests::world::S;
use crate::session::tests::world::rings::{BACK, PICTURE};

const WORDS: [u8; 100] = [3; 100];
/// The client of the node on which the stream is written.
const WRITER: usize = 0;
/// One that has no say in it.
const OTHER: usize = 1;
/// A record of two parts.
const LEN: usize = LINE_PART_BYTES + 100;

fn check() -> u32 {
    crc32fast::hash(&WORDS)
}

fn part(bytes: &[u8]) -> RecordPart<'_> {
    RecordPart {
        place: BACK as u16,
        description: check(),
        incarnation: 1,
        len: LEN as u32,
        sequence: 3,
        epoch: 1,
        stamp_ns: 5,
        bytes,
        ..RecordPart::default()
    }
}

fn description() -> DescriptionPart<'static> {
    DescriptionPart {
        place: BACK as u16,
        generation: 0,
        check: check(),
        len: WORDS.len() as u32,
        offset: 0,
        written: 0,
        bytes: &WORDS,
    }
}

impl Ground {
    /// A client sends a frame besides what it has to say.
    fn takes(&mut self, from: usize, message: &SessionMessage<'_>) {
        self.receives(from, message);
        self.settle();
    }

    fn lost(&self, cause: ReplicaLoss) -> u64 {
        let counts = self.said.rings.as_ref().unwrap().line.counts();
        counts.received.iter().map(|received| received.lost.of(cause)).sum()
    }

    fn records(&self) -> u64 {
        self.said.rings.as_ref().unwrap().line.counts().received.iter().map(|received| received.records.get()).sum()
    }
}

#[test]
fn what_does_not_belong_there_is_counted_and_the_connection_goes_on() {
    let mut ground = Ground::replicated(2);
    let bytes = [7; LEN];
    let (first, second) = bytes.split_at(LINE_PART_BYTES);
    let sound = part(first);
    ground.takes(WRITER, &SessionMessage::Record(sound));
    assert_eq!(ground.lost(ReplicaLoss::Undescribed), 1);
    ground.takes(WRITER, &SessionMessage::Description(description()));
    for (from, bad, cause, why) in [
        (OTHER, sound, ReplicaLoss::Foreign, "it does not write the stream"),
        (WRITER, RecordPart { len: 30_000, ..sound }, ReplicaLoss::TooLarge, "more than the stream's records have"),
        (WRITER, RecordPart { offset: 9, bytes: second, ..sound }, ReplicaLoss::Unsound, "no part begins there"),
        (WRITER, RecordPart { bytes: second, ..sound }, ReplicaLoss::Unsound, "shorter than a part"),
        (WRITER, RecordPart { stamp_ns: 0, ..sound }, ReplicaLoss::Unsound, "without a stamp"),
        (WRITER, RecordPart { sequence: 1 << 60, ..sound }, ReplicaLoss::Unsound, "no stream comes to so many"),
        (WRITER, RecordPart { description: 9, ..sound }, ReplicaLoss::Undescribed, "by another description"),
    ] {
        let before = ground.lost(cause);
        ground.takes(from, &SessionMessage::Record(bad));
        assert_eq!(ground.lost(cause), before + 1, "{why}");
    }
    ground.takes(OTHER, &SessionMessage::Description(description()));
    assert_eq!(ground.lost(ReplicaLoss::Foreign), 2, "nor does it describe it");
    for place in [PICTURE as u16, 9] {
        ground.takes(WRITER, &SessionMessage::Record(RecordPart { place, ..sound }));
    }
    let line = |ground: &Ground| ground.said.rings.as_ref().unwrap().line.unknown().get();
    assert_eq!((line(&ground), ground.records()), (2, 0), "the server has no replica of these");

    ground.takes(WRITER, &SessionMessage::Record(sound));
    ground.takes(WRITER, &SessionMessage::Record(sound));
    assert_eq!(ground.lost(ReplicaLoss::Duplicate), 1);
    let last = RecordPart { offset: LINE_PART_BYTES as u32, bytes: second, ..sound };
    ground.takes(WRITER, &SessionMessage::Record(last));
    assert_eq!(ground.records(), 1, "beside all that, a record comes");
    ground.takes(WRITER, &SessionMessage::Record(RecordPart { sequence: 2, ..sound }));
    assert_eq!(ground.lost(ReplicaLoss::Late), 1, "an older one does not");
    assert!(ground.ends.iter().all(|(client, ..)| client.is_up() && client.connections() == 1));
}

#[test]
fn a_frame_that_is_wrong_in_itself_ends_the_connection_that_it_came_by() {
    let mut ground = Ground::replicated(2);
    ground.takes(WRITER, &SessionMessage::Description(description()));
    let bytes = [7; LINE_PART_BYTES];
    ground.takes(WRITER, &SessionMessage::Record(part(&bytes)));
    ground.takes(WRITER, &SessionMessage::Record(RecordPart { offset: u32::MAX, ..part(&bytes) }));
    assert!(!ground.ends[WRITER].0.is_up() && ground.ends[OTHER].0.is_up());
    assert_eq!(ground.lost(ReplicaLoss::Incomplete), 1, "what was under way is given up with it");
}

#[test]
fn a_node_that_is_another_client_by_now_gets_nothing_any_more() {
    let mut ground = Ground::replicated(2);
    ground.takes(WRITER, &SessionMessage::Description(description()));
    let (now_ns, (client, ..)) = (ground.now_ns, &mut ground.ends[WRITER]);
    client.host(now_ns, Vec::new());
    ground.pass(crate::session::LOOK_EVERY_NS);
    let bytes = [7; LINE_PART_BYTES];
    ground.takes(WRITER, &SessionMessage::Record(part(&bytes)));
    assert_eq!(ground.lost(ReplicaLoss::Foreign), 1, "it is not that node without its name");
}

/// Each would make a ring, in the thread that all clients share.
#[test]
fn a_stream_that_is_made_anew_all_the_time_is_so_once_a_second() {
    let mut ground = Ground::replicated(2);
    ground.takes(WRITER, &SessionMessage::Description(description()));
    let anew = |number: u16| RecordPart {
        generation: number,
        len: 1,
        sequence: 0,
        stamp_ns: 5 + u64::from(number),
        ..part(&[7])
    };
    for second in 1..=3 {
        for number in 0..100 {
            ground.takes(WRITER, &SessionMessage::Record(anew(1000 * second + number)));
        }
        let lost = ground.lost(ReplicaLoss::Unwritable);
        assert_eq!((ground.records(), lost), (second.into(), 99 * u64::from(second)));
        ground.now_ns += S;
    }
    // So are descriptions, of which each takes all rings of its module away.
    let lost = ground.lost(ReplicaLoss::Undescribed);
    for number in 0..10 {
        let bytes = [100 + number; 100];
        let described =
            DescriptionPart { generation: 4000, check: crc32fast::hash(&bytes), bytes: &bytes, ..description() };
        ground.takes(WRITER, &SessionMessage::Description(described));
    }
    assert_eq!(ground.lost(ReplicaLoss::Undescribed), lost + 9);
}
