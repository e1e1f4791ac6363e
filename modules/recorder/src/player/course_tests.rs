//! A course by a clock that jumps to where it waits.

use super::*;
use rohrpost::schema::Type;
use rohrpost_recording::{ChannelSpec, Options, Session, Writer};
use std::collections::BTreeMap;

/// What a course did.
#[derive(Debug, PartialEq, Clone, Copy)]
enum Did {
    Begun(u64),
    /// The value that arrived then, at this time of the node.
    Played(u64, u64),
    /// The value of this stamp, from before the place where it began.
    Older(u64),
    Advanced(u64),
    Round,
    Ended,
}

use Did::{Advanced, Begun, Ended, Older, Played, Round};

/// Arrivals and their epochs.
const STEPPED: [(u64, u64); 5] = [(100, 1), (150, 1), (150, 1), (40, 2), (90, 2)];

struct CourseTest {
    course: Course,
    now_ns: u64,
    _folder: tempfile::TempDir,
}

impl CourseTest {
    fn new(values: &[(u64, u64)], part: Part) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let options = Options { leave_bytes: 0, ..Options::new(folder.path(), "base") };
        let mut writer = Writer::start(options, Session::default()).unwrap();
        let spec = ChannelSpec { name: "motor.0", item: "speed", ty: &Type::U8, texts: BTreeMap::new() };
        let channel = writer.channel(&spec).unwrap();
        for (arrival_ns, epoch) in values.iter().copied() {
            let message = Message { arrival_ns, stamp_ns: arrival_ns, epoch, sequence: 0, data: &[7] };
            writer.write(channel, &message).unwrap();
        }
        writer.finish().1.unwrap();
        let player = Player::new(vec![folder.path().join("base-0001.mcap")], |_| true);
        Self { course: Course::new(player, part).unwrap(), now_ns: 1, _folder: folder }
    }

    /// Until it rests, or has done so much.
    fn go(&mut self, most: usize) -> Vec<Did> {
        let mut did = Vec::new();
        while did.len() < most {
            match self.course.next(self.now_ns).unwrap() {
                Move::Begin { system_ns, .. } => {
                    self.now_ns = system_ns;
                    did.push(Begun(system_ns));
                }
                Move::Play { channel, message, .. } if channel.is_repeated() => {
                    assert_eq!(message.arrival_ns, self.now_ns, "where it is played");
                    did.push(Older(message.stamp_ns));
                }
                Move::Play { time_ns, message, .. } => {
                    let arrival_ns = message.arrival_ns;
                    self.now_ns = self.now_ns.max(time_ns.unwrap_or_default());
                    did.push(Played(arrival_ns, self.now_ns));
                }
                Move::Advance { time_ns } => {
                    self.now_ns = time_ns;
                    did.push(Advanced(time_ns));
                }
                Move::Wait { until_ns } => {
                    assert!(until_ns > self.now_ns);
                    self.now_ns = until_ns;
                }
                Move::Again => {}
                Move::Round => did.push(Round),
                Move::End => did.push(Ended),
                Move::Rest => break,
            }
        }
        did
    }
}

#[test]
fn it_begins_paused_and_plays_to_its_end() {
    let mut test = CourseTest::new(&STEPPED, Part::default());
    assert_eq!(test.go(9), [Begun(100)], "there is a time, and nothing is played");
    assert_eq!(test.go(9), []);
    test.course.resume();
    let all = [Played(100, 100), Played(150, 150), Played(150, 150), Begun(40), Played(40, 40), Played(90, 90), Ended];
    assert_eq!(test.go(9), all);
    assert_eq!((test.go(9), test.course.has_ended()), (vec![], true));
    test.course.seek(90).unwrap();
    let rest = [Begun(100), Played(100, 100), Played(150, 150), Played(150, 150)];
    assert_eq!(test.go(4), rest, "the first one of the file that arrived at 90 or later");
}

#[test]
fn in_a_pause_it_goes_step_by_step() {
    let mut test = CourseTest::new(&STEPPED, Part::default());
    test.course.step();
    assert_eq!(test.go(9), [Begun(100), Played(100, 100)]);
    test.course.step();
    assert_eq!(test.go(9), [Played(150, 150)], "one of two at once");
    test.course.step();
    test.course.step();
    assert_eq!(test.go(9), [Played(150, 150)], "told twice before it was done");
    test.course.step_until(170);
    let did = test.go(9);
    assert_eq!(did, [Begun(40), Played(40, 40), Advanced(60)], "20 ns are left behind the step of time");
    test.course.step_until(80);
    assert_eq!(test.go(9), [Advanced(80)]);
    test.course.step_until(1_000);
    assert_eq!(test.go(9), [Played(90, 90), Ended]);
    test.course.step();
    assert_eq!(test.go(9), []);
}

#[test]
fn a_pause_stops_at_once_and_a_seek_shows_where_it_is() {
    let mut test = CourseTest::new(&STEPPED, Part::default());
    test.course.resume();
    assert_eq!(test.go(2), [Begun(100), Played(100, 100)]);
    test.course.pause();
    assert_eq!(test.go(9), []);
    test.course.seek(120).unwrap();
    assert_eq!(test.go(9), [Begun(120), Older(100)], "what is true there is played in a pause, too");
    test.course.seek(0).unwrap();
    assert_eq!(test.go(9), [Begun(100)]);
    test.course.seek(151).unwrap();
    assert_eq!(test.go(9), [Ended]);
    test.course.seek(120).unwrap();
    test.course.resume();
    assert_eq!(test.go(4), [Begun(120), Older(100), Played(150, 150), Played(150, 150)]);
}

#[test]
fn where_it_begins_the_newest_of_before_waits_until_somebody_listens_and_is_no_step() {
    let part = Part { from_ns: Some(120), ..Part::default() };
    let mut test = CourseTest::new(&STEPPED, part);
    assert_eq!(test.go(9), [Begun(120)]);
    test.course.pause();
    assert_eq!(test.go(9), [Older(100)]);
    test.course.step();
    assert_eq!(test.go(9), [Played(150, 150)]);
    let mut test = CourseTest::new(&STEPPED, part);
    test.course.step();
    assert_eq!(test.go(9), [Begun(120), Older(100), Played(150, 150)]);
}

#[test]
fn between_two_rounds_there_is_a_place_to_wait() {
    for (values, part, round) in [
        (&[(100, 1)][..], Part { repeats: true, ..Part::default() }, &[Begun(100), Played(100, 100)][..]),
        (
            &[(100, 1), (150, 1)],
            Part { from_ns: Some(150), repeats: true, ..Part::default() },
            &[Begun(150), Older(100), Played(150, 150)],
        ),
    ] {
        let mut test = CourseTest::new(values, part);
        test.course.resume();
        let rounds = [round, &[Round], round, &[Round]].concat();
        assert_eq!(test.go(rounds.len()), rounds);
    }
}

#[test]
fn a_part_is_played_over_and_over() {
    let part = Part { from_ns: Some(101), until_ns: Some(160), repeats: true };
    let values = [(100, 1), (150, 1), (159, 1), (160, 1)];
    let mut test = CourseTest::new(&values, part);
    test.course.resume();
    let round = [Begun(101), Older(100), Played(150, 150), Played(159, 159), Round];
    assert_eq!(test.go(10), [round, round].concat());
    assert_eq!(test.course.rounds(), 2);
    for (part, did) in [
        (Part { from_ns: Some(300), until_ns: None, repeats: true }, vec![Ended]),
        (Part { from_ns: None, until_ns: Some(50), repeats: true }, vec![Ended]),
        (Part { from_ns: None, until_ns: Some(120), repeats: false }, vec![Begun(100), Played(100, 100), Ended]),
    ] {
        let mut test = CourseTest::new(&values, part);
        test.course.resume();
        assert_eq!(test.go(9), did, "{part:?}");
    }
}
