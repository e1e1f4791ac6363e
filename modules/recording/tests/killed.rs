//! A recorder is killed at any moment: what it had told to be written is there, in order, and nothing else.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Running, busy_options, channels, in_role, recover_all, session, tell, with_message};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rohrpost_recording::Writer;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Kills, unless `ROHRPOST_RECORDING_KILLS` says how many.
const KILLS: u64 = 60;

#[test]
fn role() {
    let Some((_, folder)) = common::role() else { return };
    record(&folder);
}

/// Records until it is killed, and tells how much is written.
fn record(folder: &Path) {
    let mut writer = Writer::start(busy_options(folder), session()).unwrap();
    let channels = channels(&mut writer);
    let mut told = Instant::now();
    for number in 0.. {
        with_message(number, |channel, message| writer.write(channels[channel], message)).unwrap();
        if told.elapsed() < Duration::from_micros(500) {
            continue;
        }
        let status = writer.status();
        tell(&status.written.to_string());
        // No faster than the disk, so that none is lost.
        while writer.status().waiting > 3_000 {
            std::thread::sleep(Duration::from_micros(200));
        }
        told = Instant::now();
    }
}

#[test]
fn what_a_killed_recorder_had_written_is_recovered_to_the_last_message() {
    let seed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let asked = std::env::var("ROHRPOST_RECORDING_KILLS").ok();
    let kills = asked.map_or(KILLS, |kills| kills.parse().unwrap());
    let (mut files, mut cut, mut most) = (0, 0, 0);
    for round in 0..kills {
        let folder = tempfile::tempdir().unwrap();
        let mut running = Running::start(in_role("record", folder.path()));
        let mut written: u32 = running.hear().unwrap().parse().unwrap();
        let pid = Pid::from_raw(running.child.id() as i32);
        let wait = Duration::from_micros(chance.random_range(0..150_000));
        let killer = std::thread::spawn(move || {
            std::thread::sleep(wait);
            kill(pid, Signal::SIGKILL).unwrap();
        });
        while let Some(line) = running.hear() {
            written = line.parse().unwrap();
        }
        killer.join().unwrap();
        running.child.wait().unwrap();
        let (found, reports) = recover_all(folder.path());
        assert!(found >= written, "round {round}: {written} were written, {found} are there; seed {seed}");
        assert!(reports.iter().rev().skip(1).all(|report| report.was_closed), "only the last one is open: {reports:?}");
        files += reports.len();
        cut += reports.iter().filter(|report| report.damage_count > 0).count();
        most = most.max(found);
    }
    println!("{files} files, {cut} of them cut inside of a record, up to {most} messages; seed {seed}");
    assert!(files as u64 > kills && most > 1_000, "too slow to say anything");
}
