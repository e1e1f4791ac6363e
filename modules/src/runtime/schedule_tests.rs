//! Ticks by times that are written, not by times that pass: a node's time that stands still says what was written.

use super::*;
use rohrpost_mailbox::{Node, TimeKeeper, TimeRecord, TimeSource as Source};
use std::sync::Arc;

const MS: u64 = 1_000_000;
const PERIOD: Duration = Duration::from_millis(50);

const CONFIG: &str = r#"
installation = "one"
[system]
name = "robot"
id = 1
[classes]
pilot = { id = 140, text = "Steers" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[time]
source = "SOURCE"
[[module]]
name = "pilot.0"
program = "pilot"
optional = true
"#;

/// A node and the writer of its time.
struct Ground {
    _directory: tempfile::TempDir,
    node: Arc<Node>,
    keeper: TimeKeeper,
}

impl Ground {
    /// Its time stands still at `at_ns`.
    fn at(at_ns: u64) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
        let keeper = TimeKeeper::begin(&node, Source::Log, at_ns, 0.0).unwrap();
        Self { _directory: directory, node, keeper }
    }

    /// From now on it is so late, and time passes at this pace.
    fn write(&mut self, epoch_more: u64, system_ns: u64, pace_ppb: u64) {
        let last = self.keeper.record().unwrap();
        let (epoch, monotonic_ns) = (last.epoch + epoch_more, monotonic_ns());
        assert!(self.keeper.write(&TimeRecord { epoch, system_ns, pace_ppb, monotonic_ns, ..last }));
    }

    fn schedule(&self) -> Schedule {
        let clock = SystemClock::open(&self.node);
        let mut schedule = Schedule { seen: seen(&clock), node: Some(clock), ticks: None, wake_up: WakeUp::default() };
        schedule.set_period(PERIOD);
        schedule
    }
}

/// Ticks that are due now.
fn ticks(schedule: &mut Schedule) -> usize {
    (0..100)
        .take_while(|_| {
            let (now, _) = schedule.look();
            schedule.take_tick(now)
        })
        .count()
}

#[test]
fn ticks_follow_the_nodes_time_and_while_that_stands_still_there_is_none() {
    let mut ground = Ground::at(1000 * MS);
    let mut schedule = ground.schedule();
    for (at_ms, expected, why) in [
        (1000, 0, "time has not passed"),
        (1001, 1, "the first one is at once"),
        (1001, 0, "it stands still"),
        (1050, 0, "due is not yet over"),
        (1051, 1, "one period"),
        (1099, 0, "not yet"),
        (1251, 1, "what was slept through is not made up for"),
        (1300, 0, "the grid stays where it was"),
        (1301, 1, "on the grid"),
    ] {
        ground.write(0, at_ms * MS, 0);
        assert_eq!(ticks(&mut schedule), expected, "at {at_ms} ms: {why}");
    }
    schedule.restart();
    assert_eq!(ticks(&mut schedule), 0, "switched on while time stands still");
}

#[test]
fn a_step_leaves_what_was_left_of_the_period() {
    for (to_ms, why) in [(0, "back"), (1030, "nowhere"), (1031, "a little"), (86_400_000, "a day ahead")] {
        let mut ground = Ground::at(1000 * MS);
        let mut schedule = ground.schedule();
        ground.write(0, 1001 * MS, 0);
        assert_eq!(ticks(&mut schedule), 1);
        ground.write(0, 1030 * MS, 0);
        assert_eq!(ticks(&mut schedule), 0);
        // 20 ms are left.
        ground.write(1, to_ms * MS, 0);
        let (now, step) = schedule.look();
        assert_eq!(now.work_ns, to_ms * MS);
        assert_eq!(step, Some(ClockStep { from_ns: 1030 * MS, to_ns: to_ms * MS }), "{why}");
        assert_eq!((ticks(&mut schedule), schedule.look().1), (0, None), "{why}: a step is told once");
        ground.write(0, (to_ms + 20) * MS, 0);
        assert_eq!(ticks(&mut schedule), 0, "{why}");
        ground.write(0, (to_ms + 21) * MS, 0);
        assert_eq!(ticks(&mut schedule), 1, "{why}");
    }
}

#[test]
fn a_writer_that_lets_time_go_back_within_its_epoch_stops_no_ticks() {
    let mut schedule = Ground::at(1000 * MS).schedule();
    assert_eq!(schedule.see(1, 5000 * MS), None);
    assert!(schedule.take_tick(WorkMoment { monotonic_ns: 0, work_ns: 5000 * MS }));
    assert!(schedule.see(1, 10 * MS).is_some());
    assert!(schedule.tick_ns().unwrap() <= 60 * MS);
}

#[test]
fn ticks_begin_with_the_nodes_time() {
    let directory = tempfile::tempdir().unwrap();
    let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
    let waits = TimeKeeper::await_source(&node, Source::Log).unwrap();
    let clock = SystemClock::open(&node);
    let mut schedule = Schedule { seen: seen(&clock), node: Some(clock), ticks: None, wake_up: WakeUp::default() };
    schedule.set_period(PERIOD);
    assert_eq!(ticks(&mut schedule), 0);
    drop(waits);
    let _keeper = TimeKeeper::begin(&node, Source::Log, 976_052_857_000_000_000, 1.0).unwrap();
    let (now, step) = schedule.look();
    assert_eq!((step.map(|step| step.to_ns), schedule.tick_ns()), (Some(now.work_ns), Some(now.work_ns)));
}

#[test]
fn a_wait_lasts_until_time_has_passed_what_is_due() {
    for (left_ns, pace_ppb, expected_ns, why) in [
        (0, BILLION, 0, "over"),
        (1000, BILLION, 1000, "real time"),
        (1000, 10 * BILLION, 100, "ten times as fast"),
        (1001, 10 * BILLION, 101, "never too short"),
        (1000, BILLION / 4, 4000, "slower"),
        (1, 1, BILLION, "as slow as can be"),
        (u64::MAX, 1, u64::MAX, "too long to say"),
        (0, 0, u64::MAX, "time stands still"),
    ] {
        assert_eq!(paced_ns(left_ns, pace_ppb), expected_ns, "{why}");
    }
}

#[test]
fn a_wait_is_bounded_only_where_time_may_change_its_pace() {
    let mut ground = Ground::at(1000 * MS);
    let mut schedule = ground.schedule();
    let hour_ns = 3_600_000 * MS;
    let now_ns = monotonic_ns();
    assert_eq!(schedule.wait_ns(now_ns, 1000 * MS), LOOK_NS, "it stands still");
    ground.write(0, 1000 * MS, 10 * BILLION);
    let written_ns = ground.keeper.record().unwrap().monotonic_ns;
    assert_eq!(schedule.wait_ns(written_ns, 1000 * MS + hour_ns), LOOK_NS, "it may stop, or run faster");
    assert_eq!(schedule.wait_ns(written_ns, 1000 * MS + 99_999), 10_000);
    schedule.use_computer_clock();
    assert_eq!(schedule.wait_ns(now_ns, now_ns + hour_ns), hour_ns);
    assert_eq!(schedule.look().1, None);
    let due_ns = schedule.tick_ns().unwrap();
    assert!((now_ns..=monotonic_ns()).contains(&due_ns), "ticks are by the computer's clock now");
    assert!(schedule.take_tick(WorkMoment { monotonic_ns: due_ns + 1, work_ns: due_ns + 1 }));
}

#[test]
fn only_simulated_and_replayed_time_is_followed() {
    let ground = Ground::at(1000 * MS);
    let clock = SystemClock::open(&ground.node);
    for (time, follows) in [("local", false), ("simulation", true), ("log", true)] {
        let text = CONFIG.replace("SOURCE", time);
        let installation = Installation::parse(&text, std::path::Path::new("robot.toml")).unwrap();
        let moment = Schedule::new(&installation, &clock).moment();
        assert_eq!(moment.work_ns == 1000 * MS, follows, "{time}");
    }
}

#[test]
fn a_tick_that_is_asked_for_comes_once_and_at_its_moment() {
    let mut schedule = Schedule { node: None, seen: (0, 0), ticks: None, wake_up: WakeUp::default() };
    let moment = |monotonic_ns| WorkMoment { monotonic_ns, work_ns: monotonic_ns };
    let wake_up = schedule.wake_up();
    assert!(!schedule.take_tick(moment(1)));
    wake_up.at(Some(10));
    assert_eq!((schedule.wake_up_ns(), schedule.take_tick(moment(9))), (Some(10), false));
    assert_eq!((schedule.take_tick(moment(10)), schedule.take_tick(moment(11))), (true, false));
    wake_up.at(Some(20));
    wake_up.at(None);
    assert!(!schedule.take_tick(moment(30)));
}
