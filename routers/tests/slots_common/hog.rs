//! A process that goes before routers, on all processors at once and in bursts.

use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::Signal;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_nanosleep};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_mailbox::sys::{Reservation, Scheduling, reserve, schedule};
use rohrpost_routers::shell::slots::ActualScheduling;
use rohrpost_testbed::lan::{Killed, role};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

const HOG: &str = "ROHRPOST_TEST_HOG";
const MS: u64 = 1_000_000;
/// A burst, and from one to the next: cycles are not so long, so each window is met by some.
const BURST_NS: u64 = 24 * MS / 10;
const EVERY_NS: u64 = 65 * MS / 10;
/// Of two threads that have reserved their time the one goes first that has to be through earlier: routers have 10 ms.
/// After this it may begin anew.
const DEADLINE_NS: u64 = 5 * MS;
/// Above that of routers, where they could not reserve any.
const FIFO: u8 = 90;

/// Runs until it is dropped.
pub(crate) struct Hog {
    _process: Killed,
}

impl Hog {
    /// Starts it, and waits until it is at work. `test` is the test of this program that calls [`be_a_hog`], `routers`
    /// what routers were granted. None where it may not go before them.
    pub(crate) fn start(test: &str, routers: ActualScheduling) -> Option<Self> {
        let mut command = role(test, HOG, routers.word());
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        let granted = lines.filter_map(|line| line.split_once("hog: ").map(|(_, granted)| granted == "granted")).next();
        let hog = Self { _process: Killed(child) };
        granted.unwrap_or(false).then_some(hog)
    }
}

fn goes_first(how: &str) -> bool {
    if how != ActualScheduling::Reserved.word() {
        return schedule(Scheduling::Fifo(FIFO)).is_ok();
    }
    let wanted = Reservation { runtime_ns: DEADLINE_NS / 2, deadline_ns: DEADLINE_NS, period_ns: DEADLINE_NS };
    reserve(wanted).is_ok()
}

const _: () = assert!(BURST_NS < DEADLINE_NS / 2 && DEADLINE_NS < EVERY_NS, "it has reserved a whole burst");

/// All threads at the same moments.
fn spin_in_bursts() -> ! {
    loop {
        let begin_ns = monotonic_ns().next_multiple_of(EVERY_NS);
        let begin = TimeSpec::new((begin_ns / (1000 * MS)).cast_signed(), (begin_ns % (1000 * MS)).cast_signed());
        let _ = clock_nanosleep(ClockId::CLOCK_BOOTTIME, ClockNanosleepFlags::TIMER_ABSTIME, &begin);
        while monotonic_ns() < begin_ns + BURST_NS {
            std::hint::spin_loop();
        }
    }
}

/// In the process of a [`Hog`] it is one, until it is killed; elsewhere it does nothing.
pub(crate) fn be_a_hog() {
    let Ok(how) = std::env::var(HOG) else { return };
    // Of the thread that started it.
    set_pdeathsig(Some(Signal::SIGKILL)).unwrap();
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let (grants, granted) = std::sync::mpsc::channel();
    for _ in 0..processors {
        let (grants, how) = (grants.clone(), how.clone());
        std::thread::spawn(move || {
            grants.send(goes_first(&how)).unwrap();
            spin_in_bursts();
        });
    }
    let all = granted.iter().take(processors).all(|granted| granted);
    println!("hog: {}", if all { "granted" } else { "refused" });
    if all {
        loop {
            std::thread::park();
        }
    }
}
