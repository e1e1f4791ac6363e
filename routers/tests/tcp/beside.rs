//! Packages on the LAN while as much as fits goes through a TCP router on the same computer: they come, and not much
//! later.

use crate::hostile::Target;
use crate::lan::{Pair, label, module};
use crate::sessions::Raw;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_mailbox::{Head, Priority, Receiver, Sender, Shape, Type, monotonic_ns};
use rohrpost_routers::session::frame::{Carried, SessionMessage};
use rohrpost_testbed::report;
use rohrpost_testbed::stalls::{Late, Stalls, unless_stalled};
use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// So many packages, each as soon as the one before has come, and until the flood has brought more than this.
const PACKAGES: usize = 1000;
const FLOOD_BYTES: u64 = 1_000_000;
/// The first ones open mailboxes, and find the memory.
const WARM_UP: usize = 50;
const PAUSE: Duration = Duration::from_micros(500);
/// A package comes within this: all threads on its way are in real time, those of the flood are not.
const BOUND: Duration = Duration::from_millis(5);
/// What takes longer does not come any more.
const LIMIT: Duration = Duration::from_secs(60);

/// Each package comes in time while the flood goes on.
fn packages_come(
    stalls: &Stalls,
    (sender, receiver): (&mut Sender, &mut Receiver),
    carried: &AtomicU64,
) -> Result<(), Late> {
    let is_real_time = schedule(Scheduling::Fifo(1)).is_ok();
    if !is_real_time {
        report::skipped("how late packages are, without real time");
    }
    let (mut ages, mut late) = (Vec::new(), Ok(()));
    while ages.len() < PACKAGES || carried.load(Ordering::Relaxed) < FLOOD_BYTES {
        let began = Instant::now();
        let id = ages.len() as u16;
        sender.send(&label(module(0), 200, id), &[&monotonic_ns().to_le_bytes()]).unwrap();
        let published_ns = stalls.wait("a package over the LAN", LIMIT, || {
            let package = receiver.receive_timeout(Duration::from_millis(100))?;
            assert_eq!(package.head().id, id, "in order, none twice");
            Some(u64::from_le_bytes(package.body().try_into().unwrap()))
        });
        let age = Duration::from_nanos(monotonic_ns() - published_ns);
        if let Some(by) = age.checked_sub(BOUND).filter(|_| is_real_time && late.is_ok() && ages.len() >= WARM_UP) {
            late = Err(Late::now(format!("package {id} took {age:?}"), began, by));
        }
        ages.push(age);
        std::thread::sleep(PAUSE);
    }
    ages.sort_unstable();
    let [half, most] = [ages.len() / 2, ages.len() - 1].map(|at| ages[at]);
    eprintln!("packages on the LAN beside a flood: p50 {half:?}, at most {most:?}; {carried:?} B carried");
    late
}

#[test]
fn packages_on_the_lan_come_beside_a_flood_of_a_tcp_router() {
    unless_stalled(|stalls| {
        let (target, pair) = (Target::start(None), Pair::new());
        let [mut from, mut to] = [4, 3].map(|system| {
            let mut raw = Raw::new(target.address, system, crate::ground::COMMON);
            raw.hosts(system);
            raw
        });
        let mut heard = pair.sides[1].receiver(module(1), Shape { slots: 64, ..Shape::default() });
        let mut sender = pair.sides[0].sender(module(1));
        let (to_name, from_name) = (crate::ground::module(3), crate::ground::module(4));
        let (kind, priority) = (Type::data(1), Priority(90));
        let head = Head { to: to_name, from: from_name, len: 1000, kind, priority, ..Head::default() };
        let one = SessionMessage::Package(Carried { hops: 0, published_ns: 0, head, body: &[0; 1000] });
        let flood = one.to_bytes().repeat(32);
        let (ends, carried) = (AtomicBool::new(false), AtomicU64::new(0));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !ends.load(Ordering::Relaxed) {
                    from.0.write_all(&flood).unwrap();
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
            // In a thread of its own: it goes before the flood, and others would inherit that.
            let comes = scope.spawn(|| packages_come(stalls, (&mut sender, &mut heard), &carried)).join();
            ends.store(true, Ordering::Relaxed);
            comes.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    });
}
