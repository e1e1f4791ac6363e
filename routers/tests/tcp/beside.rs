//! Packages on the LAN while as much as fits goes through a TCP router on the same computer: they come, and not much
//! later.

use crate::ground::{PATIENCE, wait};
use crate::hostile::Target;
use crate::lan::{Pair, label, module};
use crate::sessions::Raw;
use rohrpost_mailbox::{Head, Priority, Shape, Type, monotonic_ns};
use rohrpost_routers::session::frame::{Carried, SessionMessage};
use rohrpost_testbed::stall_detector::{Watched, repeated_on_stall};
use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Quiet and flooded by turns: of each the best counts, since other work of the computer comes and goes.
const ROUNDS: usize = 6;
const PACKAGES: usize = 150;
/// So many times later than without a flood, and this, packages may be: the threads of both share the processors, here
/// without priorities.
const TIMES: u64 = 10;
const SLACK_NS: u64 = 20_000_000;
/// A flood brings more than this in a round.
const FLOOD_BYTES: u64 = 100_000;

#[test]
fn packages_on_the_lan_come_beside_a_flood_of_a_tcp_router() {
    repeated_on_stall(Watched::RealTime, || {
        let (target, pair) = (Target::start(None), Pair::new());
        let [mut from, mut to] = [4, 3].map(|system| {
            let mut raw = Raw::new(target.address, system, crate::ground::COMMON);
            raw.hosts(system);
            raw
        });
        let mut heard = pair.sides[1].receiver(module(1), Shape { slots: 64, ..Shape::default() });
        let mut sender = pair.sides[0].sender(module(1));
        let mut flood = Vec::new();
        let (to_name, from_name) = (crate::ground::module(3), crate::ground::module(4));
        let (kind, priority) = (Type::data(1), Priority(90));
        let head = Head { to: to_name, from: from_name, len: 1000, kind, priority, ..Head::default() };
        for _ in 0..32 {
            SessionMessage::Package(Carried { hops: 0, published_ns: 0, head, body: &[0; 1000] }).write(&mut flood);
        }
        let (ends, floods, carried) = (AtomicBool::new(false), AtomicBool::new(false), AtomicU64::new(0));
        let mut ages = [Vec::new(), Vec::new()];
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !ends.load(Ordering::Relaxed) {
                    if floods.load(Ordering::Relaxed) {
                        from.0.write_all(&flood).unwrap();
                    } else {
                        from.say(&SessionMessage::Ask(0));
                        std::thread::sleep(Duration::from_millis(5));
                    }
                }
            });
            scope.spawn(|| {
                let mut piece = vec![0; 1 << 16];
                while !ends.load(Ordering::Relaxed) {
                    to.say(&SessionMessage::Ask(0));
                    // It gives up after some milliseconds without any.
                    carried.fetch_add(to.0.read(&mut piece).unwrap_or(0) as u64, Ordering::Relaxed);
                }
            });
            for round in 0..2 * ROUNDS {
                floods.store(round % 2 == 1, Ordering::Relaxed);
                let before = carried.load(Ordering::Relaxed);
                let mut round_ages = Vec::new();
                let is_flooded = || carried.load(Ordering::Relaxed) - before > FLOOD_BYTES;
                let began = Instant::now();
                while round_ages.len() < PACKAGES || (round % 2 == 1 && !is_flooded() && began.elapsed() < PATIENCE) {
                    let label = label(module(0), 200, round_ages.len() as u16);
                    sender.send(&label, &[&monotonic_ns().to_le_bytes()]).unwrap();
                    let package = wait("a package over the LAN", || {
                        let package = heard.receive_timeout(Duration::from_millis(100))?;
                        Some(u64::from_le_bytes(package.body().try_into().unwrap()))
                    });
                    round_ages.push(monotonic_ns() - package);
                    std::thread::sleep(Duration::from_micros(500));
                }
                round_ages.sort_unstable();
                ages[round % 2].push(round_ages[round_ages.len() * 9 / 10]);
                assert!(round % 2 == 0 || is_flooded(), "no flood within {PATIENCE:?}");
            }
            ends.store(true, Ordering::Relaxed);
        });
        let [quiet, beside] = ages.each_ref().map(|ages| *ages.iter().min().unwrap());
        eprintln!(
            "p90 of packages on the LAN: {} µs, beside a flood {} µs; {} B carried",
            quiet / 1000,
            beside / 1000,
            carried.into_inner()
        );
        assert!(beside < TIMES * quiet + SLACK_NS, "{quiet} ns, and beside a flood {beside} ns");
    });
}
