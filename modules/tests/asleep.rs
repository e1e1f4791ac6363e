//! A caller that sleeps with its computer, played by a time namespace: what passed meanwhile counts as the age of its
//! command.
//!
//! Without a test harness: only a process of one thread may enter a time namespace.

#![allow(clippy::unwrap_used, reason = "this is a test")]

use nix::sched::{CloneFlags, setns, unshare};
use rohrpost_mailbox::{Name, Node, Participant, Receiver, Shape, monotonic_ns};
use rohrpost_modules::call::{CallEnvelope, CallError, Link};
use std::fs::{self, File};
use std::time::{Duration, Instant};

const CALLER: Name = Name::new(1, 90, 1, 0);
const SERVER: Name = Name::new(1, 200, 1, 0);
const HOUR: Duration = Duration::from_secs(3600);

/// From now on this computer has slept for so long since the test began; whether that could be arranged.
fn sleep_until(asleep: Duration) -> bool {
    let time = CloneFlags::from_bits_retain(nix::libc::CLONE_NEWTIME);
    if unshare(time).is_err() {
        return false;
    }
    fs::write("/proc/self/timens_offsets", format!("boottime {} 0", asleep.as_secs())).unwrap();
    setns(File::open("/proc/self/ns/time_for_children").unwrap(), time).unwrap();
    true
}

/// The age that each command in the mailbox says, us.
fn ages_us(server: &mut Receiver) -> Vec<u32> {
    std::iter::from_fn(|| {
        let package = server.try_receive()?;
        Some(CallEnvelope::split(package.body()).unwrap().0.age_us)
    })
    .collect()
}

fn main() {
    let directory = tempfile::tempdir().unwrap();
    let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
    let join = |name| Participant::join(&node, name).unwrap();
    let mut server = join(SERVER).receiver(SERVER, Shape::default()).unwrap();
    let caller = join(CALLER);
    let replies = caller.receiver(CALLER.with_local(1), Shape::default()).unwrap();
    let mut link = Link::new(&caller, CALLER, replies);
    let begin = |link: &mut Link, timeout| link.begin(SERVER, 16, 77, timeout, |_| Ok(())).unwrap();

    let (short, long) = (begin(&mut link, HOUR / 2), begin(&mut link, 8 * HOUR / 7));
    assert_eq!(ages_us(&mut server), [0, 0]);
    let (before, before_ns) = (Instant::now(), monotonic_ns());
    if !sleep_until(HOUR) {
        return rohrpost_testbed::report::skipped("a sleep of the computer; no time namespace for this user");
    }
    assert!(before.elapsed() < HOUR && monotonic_ns() - before_ns >= 3_600_000_000_000, "the computer slept");

    let outcome = link.poll(short).expect("its time is over");
    assert!(matches!(outcome, Err(CallError::Timeout(SERVER, _))), "{outcome:?}");
    assert_eq!(ages_us(&mut server), [0_u32; 0], "and it is not sent again");
    assert!(link.poll(long).is_none(), "there is time left");
    let [age_us] = ages_us(&mut server)[..] else { panic!("sent again once") };
    assert!(age_us >= 3_600_000_000, "it is as old as the time that passed: {age_us} us");

    // A waiting caller is told at once, however long it would have waited awake.
    assert!(sleep_until(2 * HOUR));
    let waited = Instant::now();
    assert!(matches!(link.wait(long, |_| Ok(())), Err(CallError::Timeout(SERVER, _))));
    assert!(waited.elapsed() < HOUR / 2);
    link.close();
    println!("a command of a caller that slept is as old as the time that passed");
}
