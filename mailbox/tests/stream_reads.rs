//! A stream's writer at full speed beside readers in each way of reading, for a long time: each record that is read is
//! whole and in order, and each account is exact.
//!
//! In the full run 10^8 records of 64 B to 4 KiB are read, and a thousandth as many of 1 MiB:
//! `ROHRPOST_STREAM_READS=100000000 cargo test -p rohrpost-mailbox --test stream_reads -- --nocapture`

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::crew::{Actor, alone, master};
use common::random::Random;
use common::records::Records;
use common::stream_load::{Ledger, Reading, Writing, records_between};
use common::{Ground, tell, until};
use rohrpost_mailbox::StreamShape;
use std::sync::atomic::Ordering::SeqCst;
use std::time::{Duration, Instant};

/// Held and copied, asleep and not.
const READERS: usize = 4;
const MEBIBYTE: usize = 1 << 20;
/// Says that it lives so often.
const TELL_EVERY: Duration = Duration::from_secs(10);

fn reads() -> u64 {
    std::env::var("ROHRPOST_STREAM_READS").map_or(200_000, |reads| reads.parse().expect("a number of reads"))
}

const fn shape(record_bytes: usize, keep: u32) -> StreamShape {
    StreamShape { record_bytes: record_bytes as u32, keep, readers: READERS as u16, late: Duration::ZERO }
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    master(|| match role.as_str() {
        "small" => read(&ground, shape(4096, 64), &records_between(64, 4096), reads()),
        // One is whole, the others have a last page that is not.
        "large" => {
            let records = Records::new((0..7).map(|at| MEBIBYTE - 100 * at));
            read(&ground, shape(MEBIBYTE, 4), &records, (reads() / 1000).max(1));
        }
        other => panic!("no role {other}"),
    });
    tell("done");
}

#[test]
fn small_records_are_read_whole_beside_a_writer_at_full_speed() {
    alone(&Ground::in_memory(), "small");
}

#[test]
fn records_of_a_mebibyte_are_read_whole_beside_a_writer_at_full_speed() {
    alone(&Ground::in_memory(), "large");
}

fn read(ground: &Ground, shape: StreamShape, records: &Records, reads: u64) {
    let ledger = Ledger::new(READERS);
    let mut random = Random::from_environment();
    let mut seed = || Random::new(random.below(1 << 40));
    let (path, body) = (ground.path(), vec![0; shape.record_bytes as usize]);
    let _node = ground.node();
    let writing = Writing { ledger, records, random: seed(), rests: false, body };
    let mut actors = vec![Actor::new(|| writing.write_on(path, shape))];
    for seat in 0..READERS {
        let reading = Reading { ledger, records, random: seed(), rests: false, seat, copy: Vec::new() };
        actors.push(Actor::new(|| reading.read_on(path)));
    }
    let (began, mut told) = (Instant::now(), Instant::now());
    let figures = || {
        let [written, read, lost] =
            [ledger.written(), ledger.all_read(), ledger.all_lost()].map(|word| word.load(SeqCst));
        (read, format!("{written} written, {read} read, {lost} lost in {:.1?}", began.elapsed()))
    };
    // However long it takes: a run that stands still says nothing any more.
    let mut before = 0;
    while figures().0 < reads {
        std::thread::sleep(Duration::from_millis(1));
        actors.iter().for_each(Actor::assert_alive);
        if told.elapsed() > TELL_EVERY && figures().0 > before {
            (told, before) = (Instant::now(), figures().0);
            tell(figures().1);
        }
    }
    ledger.board.hold(true);
    until("the writer holds still, and each reader accounts for all", || {
        actors.iter().for_each(Actor::assert_alive);
        ledger.board.is_still(ledger.writer()) && (0..READERS).all(|seat| ledger.is_at_rest(seat))
    });
    tell(figures().1);
    assert!(ledger.all_lost().load(SeqCst) > 0, "the writer was too slow to prove anything");
    actors.into_iter().for_each(Actor::kill);
}
