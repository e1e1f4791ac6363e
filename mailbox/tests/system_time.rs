//! System time: epochs, never back within one, whole whatever happens to its writer.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, tell};
use rohrpost_mailbox::{
    ERROR_UNKNOWN_NS, SystemClock, TimeKeeper, TimeRecord, TimeSource, Watched, monotonic_ns, realtime_ns,
};
use std::time::{Duration, Instant};

/// The killed writer's mark: an epoch of pace p begins at p times this.
const MARK_NS: u64 = 1_000_000_000_000_000;

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let node = ground.node();
    if role == "read" {
        let clock = SystemClock::open(&node);
        let (now, record) = (clock.now(), clock.record().unwrap());
        return tell(format_args!("{} {}", now.error.as_nanos(), record.error_ns));
    }
    assert_eq!(role, "write");
    tell("writing");
    for turn in u64::from(std::process::id()).. {
        let pace = 1 + turn % 9;
        let source = if pace.is_multiple_of(2) { TimeSource::Log } else { TimeSource::Simulation };
        let mut keeper = TimeKeeper::begin(&node, source, pace * MARK_NS, pace as f64).unwrap();
        for _ in 0..50 {
            keeper.set_pace(pace as f64);
        }
    }
}

#[test]
fn without_a_page_the_wall_clock_is_taken() {
    let ground = Ground::new();
    let clock = SystemClock::open(&ground.node());
    assert_eq!(clock.record(), None);
    let (before, now, after) = (realtime_ns(), clock.now(), realtime_ns());
    assert_eq!(now.epoch, 0);
    assert!((before..=after).contains(&now.ns));
    let second_ago = clock.at(monotonic_ns() - 1_000_000_000);
    assert!(second_ago.ns < realtime_ns() - 900_000_000);
}

#[test]
fn an_epoch_begins_with_every_step_and_time_follows_the_pace() {
    let (_ground, node) = Ground::made();
    for (epoch, source, system_ns, pace) in
        [(1, TimeSource::Simulation, 5_000, 0.0), (2, TimeSource::Local, 9_000, 1.0), (3, TimeSource::Log, 7_000, 2.5)]
    {
        let _keeper = TimeKeeper::begin(&node, source, system_ns, pace).unwrap();
        let clock = SystemClock::open(&node);
        let record = clock.record().unwrap();
        assert_eq!((record.epoch, record.source, record.system_ns), (epoch, source, system_ns));
        let later = clock.at(record.monotonic_ns + 1_000_000);
        assert_eq!((later.ns, later.epoch), (system_ns + (1e6 * pace) as u64, epoch));
        assert_eq!((later.age, later.error), (Duration::from_millis(1), Duration::ZERO));
        assert!(clock.now().ns >= system_ns);
    }
}

#[test]
fn another_pace_never_takes_time_back() {
    let ground = Ground::new();
    let mut keeper = TimeKeeper::begin(&ground.node(), TimeSource::Simulation, 1_000_000, 1.0).unwrap();
    let clock = SystemClock::open(&ground.node());
    let writer = std::thread::spawn(move || {
        for turn in 0..150 {
            keeper.set_pace([0.0, 3.0, 1.0, 200.0, 0.5][turn % 5]);
            let until = Instant::now() + Duration::from_millis(3);
            while Instant::now() < until {
                std::thread::yield_now();
            }
        }
    });
    let mut last = clock.now();
    let mut steps = 0;
    while !writer.is_finished() {
        let now = clock.now();
        assert_eq!(now.epoch, 1);
        assert!(now.ns >= last.ns, "back by {} ns", last.ns - now.ns);
        steps += u64::from(now.ns > last.ns);
        last = now;
    }
    assert!(steps > 100);
}

#[test]
fn a_successor_goes_on_and_writes_nothing_that_goes_back() {
    let (_ground, node) = Ground::made();
    let mut first = TimeKeeper::resume(&node).unwrap();
    assert_eq!(first.record(), None);
    let line = |monotonic_ns, system_ns, pace_ppb, epoch| TimeRecord {
        epoch,
        source: TimeSource::Master,
        monotonic_ns,
        system_ns,
        pace_ppb,
        error_ns: 5,
        drift_ns_s: 7,
    };
    let even = line(monotonic_ns(), MARK_NS, 1_000_000_000, 3);
    assert!(first.write(&even));
    drop(first);
    let mut second = TimeKeeper::resume(&node).unwrap();
    assert_eq!(second.record(), Some(even));
    let now_ns = monotonic_ns();
    for (record, is_written, why) in [
        (line(now_ns, even.at(now_ns).ns - 1_000_000, 1_000_000_000, 3), false, "it would go back"),
        (line(now_ns, even.at(now_ns).ns, 900_000_000, 3), false, "slower, and its beginning is over"),
        (line(now_ns + 1_000_000_000, even.at(now_ns + 1_000_000_000).ns, 900_000_000, 3), true, "slower, and in time"),
        (line(now_ns, even.at(now_ns).ns + 500_000_000, 1_000_000_000, 3), true, "forward"),
        (line(now_ns, 1_000, 1_000_000_000, 4), true, "another epoch may begin anywhere"),
    ] {
        let before = second.record();
        assert_eq!(second.write(&record), is_written, "{why}");
        assert_eq!(SystemClock::open(&node).record(), if is_written { Some(record) } else { before }, "{why}");
    }
}

#[test]
fn a_node_that_awaits_a_master_has_its_time_or_says_that_nobody_knows() {
    let (_ground, node) = Ground::made();
    let mut keeper = TimeKeeper::await_master(&node).unwrap();
    let unknown = keeper.record().unwrap();
    assert_eq!((unknown.epoch, unknown.source, unknown.error_ns), (0, TimeSource::Master, ERROR_UNKNOWN_NS));
    assert!(SystemClock::open(&node).now().ns.abs_diff(realtime_ns()) < 1_000_000_000);
    let known = TimeRecord { epoch: 4, error_ns: 10, ..unknown };
    assert!(keeper.write(&known));
    assert_eq!(TimeKeeper::await_master(&node).unwrap().record(), Some(known), "it goes on");
    drop(TimeKeeper::begin(&node, TimeSource::Simulation, 5, 1.0).unwrap());
    let again = TimeKeeper::await_master(&node).unwrap().record().unwrap();
    assert_eq!((again.epoch, again.error_ns), (6, ERROR_UNKNOWN_NS), "a simulation's time is not the master's");
}

#[test]
fn a_node_that_awaits_its_log_has_no_time_until_a_player_begins_it_and_not_that_of_an_earlier_player() {
    let (_ground, node) = Ground::made();
    let awaits = TimeKeeper::await_source(&node, TimeSource::Log).unwrap();
    let clock = SystemClock::open(&node);
    let record = clock.record().unwrap();
    assert_eq!((record.epoch, record.source, record.is_known()), (0, TimeSource::Log, false));
    assert_eq!((clock.now().ns, clock.at(monotonic_ns() + 1_000_000_000).ns), (1, 1), "it stands still");
    let mut player = TimeKeeper::begin(&node, TimeSource::Log, 9_000, 2.0).unwrap();
    let played = clock.record().unwrap();
    assert_eq!((played.epoch, played.is_known()), (1, true));
    assert!(player.set_pace(0.0));
    assert!(clock.record().unwrap().is_known(), "time that stands still is a time");
    drop((awaits, player));
    let _again = TimeKeeper::await_source(&node, TimeSource::Log).unwrap();
    let record = clock.record().unwrap();
    assert_eq!((record.epoch, record.is_known(), clock.now().ns), (2, false, 1));
}

#[test]
fn what_was_seen_of_the_clocks_is_left_to_the_next_writer() {
    let ground = Ground::new();
    let mut keeper = TimeKeeper::resume(&ground.node()).unwrap();
    assert_eq!(keeper.watched(), None);
    for rate_ppb in [None, Some(0), Some(-83_000_000)] {
        let watched = Watched { local_ns: 5, unslewed_ns: 4, apart_ns: 3, slept_ns: 2, rate_ppb, unsteady_until_ns: 1 };
        keeper.note_watched(&watched);
        assert_eq!(TimeKeeper::resume(&ground.node()).unwrap().watched(), Some(watched));
    }
}

/// In a time namespace, in which the computer has slept for an hour more than it has; that takes root.
#[test]
fn a_reader_after_a_sleep_is_told_that_nobody_knows_although_nobody_wrote_since() {
    let may = std::process::Command::new("unshare").args(["--time", "--boottime", "3600", "true"]).status();
    if !may.is_ok_and(|status| status.success()) {
        return rohrpost_test_report::skipped("what a reader is told after a sleep; no time namespace for this user");
    }
    for (source, slept_ns) in [(TimeSource::Master, ERROR_UNKNOWN_NS), (TimeSource::Simulation, 10)] {
        let ground = Ground::new();
        let mut keeper = TimeKeeper::await_master(&ground.node()).unwrap();
        let unknown = keeper.record().unwrap();
        assert!(keeper.write(&TimeRecord { epoch: 4, source, error_ns: 10, ..unknown }));
        assert_eq!(ground.start("read").hear(), "10 10");
        let asleep = ground.start_behind("unshare", &["--time", "--boottime", "3600"], "read");
        assert_eq!(asleep.hear(), format!("{slept_ns} {slept_ns}"), "{source:?}");
    }
}

#[test]
fn a_reader_finds_a_whole_record_however_its_writer_dies() {
    let ground = Ground::new();
    drop(TimeKeeper::begin(&ground.node(), TimeSource::Simulation, MARK_NS, 1.0).unwrap());
    let clock = SystemClock::open(&ground.node());
    let end = Instant::now() + Duration::from_secs(3);
    let (mut epoch, mut kills, mut readings) = (0, 0, 0u64);
    // On a busy computer it takes longer to kill so many.
    while Instant::now() < end || kills <= 10 || readings <= 1000 {
        let writer = ground.start("write");
        assert_eq!(writer.hear(), "writing");
        for _ in 0..(writer.id() % 7 + 1) * 2_000 {
            // None: a writer without pause overtook each try; that is no torn record, and a real one writes seldom.
            let Some(record) = clock.record() else { continue };
            readings += 1;
            let pace = record.pace_ppb / 1_000_000_000;
            let source = if pace.is_multiple_of(2) { TimeSource::Log } else { TimeSource::Simulation };
            assert_eq!((record.system_ns / MARK_NS, record.source), (pace, source), "torn: {record:?}");
            assert!(record.epoch >= epoch, "epoch {} after {epoch}", record.epoch);
            epoch = record.epoch;
        }
        writer.kill();
        kills += 1;
        assert!(clock.record().is_some(), "a dead writer stops nobody");
    }
}

/// A computer that starts in 1970 and learns the time later; and one that is set back.
#[test]
fn a_clock_that_was_set_by_a_day_or_more_is_told_apart_from_one_that_drifts() {
    const DAY_NS: u64 = 86_400_000_000_000;
    let record = |source, error_ns| TimeRecord {
        epoch: 1,
        source,
        monotonic_ns: 5_000,
        system_ns: 400 * DAY_NS,
        pace_ppb: 1_000_000_000,
        error_ns,
        drift_ns_s: 0,
    };
    let local = record(TimeSource::Local, 0);
    for (wall_ns, by_ns) in [
        (400 * DAY_NS, None),
        (401 * DAY_NS - 1, None),
        (401 * DAY_NS, Some(DAY_NS.cast_signed())),
        (399 * DAY_NS, Some(-DAY_NS.cast_signed())),
        (0, Some(-400 * DAY_NS.cast_signed())),
        (u64::MAX, Some(i64::MAX)),
    ] {
        assert_eq!(local.clock_set_by(5_000, wall_ns), by_ns, "{wall_ns}");
    }
    assert!(record(TimeSource::Master, 50).clock_set_by(5_000, 0).is_some());
    for own in
        [record(TimeSource::Log, 0), record(TimeSource::Simulation, 0), record(TimeSource::Master, ERROR_UNKNOWN_NS)]
    {
        assert_eq!(own.clock_set_by(5_000, 0), None, "no clock of a computer sets it: {own:?}");
    }
}

#[test]
fn a_new_epoch_begins_ahead_or_back_from_the_same_source() {
    let (_ground, node) = Ground::made();
    let mut keeper = TimeKeeper::begin(&node, TimeSource::Local, 5_000_000, 1.0).unwrap();
    let clock = SystemClock::open(&node);
    for (epoch, system_ns) in [(2, 1_795_733_218_000_000_000), (3, 7_000)] {
        assert_eq!(keeper.begin_epoch(system_ns), Some(epoch));
        let record = clock.record().unwrap();
        assert_eq!((record.epoch, record.source, record.system_ns), (epoch, TimeSource::Local, system_ns));
    }
    assert_eq!(TimeKeeper::resume(&Ground::new().node()).unwrap().begin_epoch(9), None, "nobody wrote the page yet");
}
