//! Deaths of the writer of system time.

use crate::ground::{Ground, each_step, nothing};
use rohrpost_mailbox_crash::{Node, SystemClock, TimeKeeper, TimeSource};

const FIRST_NS: u64 = 3_000_000_000;

/// What the page says: epoch, seconds, pace in billionths.
fn read(ground: &Ground) -> Option<(u64, u64, u64)> {
    let record = SystemClock::open(&Node::open(ground.path()).unwrap()).record()?;
    assert!(record.monotonic_ns <= rohrpost_mailbox_crash::monotonic_ns());
    Some((record.epoch, record.system_ns / 1_000_000_000, record.pace_ppb))
}

#[test]
fn a_writer_dies_beginning_the_first_epoch() {
    each_step("begin time", 8, nothing, |ground, (), death| {
        let turned = death.is_none_or(|death| death.step == "cell: published");
        assert_eq!(read(ground), turned.then_some((1, 5, 2_000_000_000)), "{death:?}");
    });
}

#[test]
fn a_writer_dies_beginning_another_epoch() {
    let scene = |ground: &Ground| drop(TimeKeeper::begin(&ground.node(), TimeSource::Local, FIRST_NS, 1.0).unwrap());
    each_step("begin time", 8, scene, |ground, (), death| {
        let turned = death.is_none_or(|death| death.step == "cell: published");
        let expected = if turned { (2, 5, 2_000_000_000) } else { (1, 3, 1_000_000_000) };
        assert_eq!(read(ground), Some(expected), "{death:?}");
        TimeKeeper::begin(&ground.node(), TimeSource::Local, 7_000_000_000, 1.0).unwrap();
        assert_eq!(read(ground), Some((expected.0 + 1, 7, 1_000_000_000)));
    });
}

#[test]
fn a_writer_dies_changing_the_pace() {
    each_step("change pace", 8, nothing, |ground, (), death| {
        let turned = death.is_none_or(|death| death.step == "cell: published");
        let pace = if turned { 3_000_000_000 } else { 2_000_000_000 };
        let (epoch, seconds, found) = read(ground).unwrap();
        assert_eq!((epoch, found), (1, pace), "{death:?}");
        assert!(seconds >= 5);
    });
}
