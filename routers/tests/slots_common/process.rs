//! A router in a process of its own, which can be killed and stopped as none of this process can.

use super::{Segment, Station, name};
use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_mailbox::{Node, monotonic_ns};
use rohrpost_routers::shell::clock::Skew;
use rohrpost_testbed::lan::{Killed, role};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

const STATION: &str = "ROHRPOST_TEST_STATION";

/// The router of a station.
pub(crate) struct Router {
    process: Killed,
}

impl Router {
    /// Starts one. `test` is the test of this program that calls [`be_a_router`].
    pub(crate) fn start(segment: &Segment, own: u8, test: &str) -> Self {
        let Station { node, skew, .. } = &segment.stations[usize::from(own)];
        let (path, Skew { begin_ns, rate_ppb, .. }) = (node.path().display(), skew);
        let mut command = role(test, STATION, &format!("{own} {begin_ns} {rate_ppb} {path}"));
        Self { process: Killed(segment.lab.command(&name(own), &mut command).unwrap()) }
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill(self.pid(), signal).unwrap();
    }

    fn pid(&self) -> Pid {
        Pid::from_raw(self.process.0.id().cast_signed())
    }

    /// Stops it for moments, again and again, with pauses between, until that is to end; then it goes on.
    pub(crate) fn stumble(&self, [moment, pause]: [Duration; 2], ends: Arc<AtomicBool>) -> JoinHandle<()> {
        let pid = self.pid();
        std::thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                kill(pid, Signal::SIGSTOP).unwrap();
                std::thread::sleep(moment);
                kill(pid, Signal::SIGCONT).unwrap();
                std::thread::sleep(pause);
            }
        })
    }

    /// Kills it, and waits until it is gone.
    pub(crate) fn kill(mut self, segment: &Segment, own: u8) {
        self.signal(Signal::SIGKILL);
        self.process.0.wait().unwrap();
        segment.deaths.borrow_mut().push((own, monotonic_ns()));
        // As launch does.
        segment.stations[usize::from(own)].node.announce_death();
    }
}

/// In the process of a [`Router`] it is one, until it is killed; elsewhere it does nothing.
pub(crate) fn be_a_router() {
    let Ok(station) = std::env::var(STATION) else { return };
    // Of the thread that started it.
    set_pdeathsig(Some(Signal::SIGKILL)).unwrap();
    let mut words = station.splitn(4, ' ');
    let mut word = || words.next().unwrap();
    let (own, begin_ns, rate_ppb) = (word().parse().unwrap(), word().parse().unwrap(), word().parse().unwrap());
    let node = Node::open(Path::new(word())).unwrap();
    let mut station = Station::new(own, node, None, begin_ns);
    station.skew.rate_ppb = rate_ppb;
    station.start_here();
    loop {
        std::thread::park();
    }
}
