//! Robots that each say a message twice a second and hear those of all others, and what that costs.

use super::systems::{TeamSystems, bench};
use crate::lan::ends::{LanSink, LanSource};
use crate::lan::flow::Outlet;
use crate::one_way::Sink;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, fill, rest};
use rohrpost_mailbox::ALL_SYSTEMS;
use std::fs;
use std::time::{Duration, Instant};

/// Each robot says something so often; they have their turns one after the other.
const PERIOD: Duration = Duration::from_millis(500);
/// Until all robots are open.
const OPEN: Duration = Duration::from_secs(1);
/// Robots end a while after what counts: what is under way comes.
const TAIL: Duration = Duration::from_millis(500);
const ENDS_WITHIN: Duration = Duration::from_secs(20);
/// Of what is said, so much has to be heard, percent: a busy computer may be late, and a team loses datagrams.
const HEARD_MIN_PERCENT: u64 = 90;

/// How many there are, what they say, and for how long.
#[derive(Clone, Copy, Debug)]
pub struct Chatter {
    /// Robots, the systems 1 and on.
    pub robots: u8,
    /// Of a message.
    pub bytes: usize,
    /// Before what counts.
    pub warm_up: Duration,
    /// What counts.
    pub counted: Duration,
}

/// A robot behind its router: what it says goes to all systems.
pub struct OurRobot(LanSource, LanSink);

impl OurRobot {
    /// Opens it on its node, in the process that will use it.
    ///
    /// # Errors
    /// When there is no mailbox, or no way to other systems.
    pub fn open(systems: &TeamSystems, system: u8, turn: u8, bytes: usize) -> Result<Self, Failure> {
        let (directory, own) = (systems.directory(system), bench(system, turn));
        let listens = LanSink::open(&directory, own, bytes)?;
        Ok(Self(LanSource::open(&directory, own, bench(ALL_SYSTEMS, turn))?, listens))
    }
}

impl Sink for OurRobot {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.0.send(message)
    }
}

impl Outlet for OurRobot {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        self.1.receive(message)
    }
}

impl Chatter {
    /// Processor time of all robots, each in a process, and of these other processes, ms a second.
    ///
    /// # Errors
    /// When a robot fails, or hears too little.
    pub fn cost<R: Sink + Outlet>(
        &self,
        others: &[i32],
        open: impl Fn(u8) -> Result<R, Failure>,
    ) -> Result<f64, Failure> {
        let begin = Instant::now() + OPEN;
        let start = |system| Child::start(|| self.live(open(system)?, system, begin));
        let robots = (1..=self.robots).map(start).collect::<Result<Vec<_>, _>>()?;
        rest(begin.saturating_duration_since(Instant::now()) + self.warm_up)?;
        let pids: Vec<i32> = robots.iter().map(Child::pid).chain(others.iter().copied()).collect();
        let (since, before_ns) = (Instant::now(), ran_ns(&pids));
        rest(self.counted)?;
        let (took, ran_ns) = (since.elapsed(), ran_ns(&pids) - before_ns);
        robots.into_iter().try_for_each(|robot| robot.finish(Instant::now() + ENDS_WITHIN))?;
        Ok(ran_ns as f64 / 1e6 / took.as_secs_f64())
    }

    fn live(&self, mut robot: impl Sink + Outlet, system: u8, begin: Instant) -> Result<(), Failure> {
        let mut due = begin + PERIOD * u32::from(system) / u32::from(self.robots);
        let end = begin + self.warm_up + self.counted + TAIL;
        let (mut said, mut heard) = (0, 0);
        let (mut message, mut room) = (vec![0; self.bytes], vec![0; self.bytes]);
        while Instant::now() < end {
            if Instant::now() >= due {
                fill(&mut message, said);
                robot.send(&message)?;
                (said, due) = (said + 1, due + PERIOD);
            }
            heard += u64::from(robot.receive(&mut room)?);
        }
        let all = said * u64::from(self.robots - 1);
        if heard * 100 < all * HEARD_MIN_PERCENT {
            return Err(Failure::Failed(format!("robot {system} has heard {heard} of {all} messages")));
        }
        Ok(())
    }
}

/// For how long these processes have run on a processor, ns.
fn ran_ns(pids: &[i32]) -> u64 {
    let threads = pids.iter().flat_map(|pid| fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten());
    let ran = |thread: fs::DirEntry| {
        let text = fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<u64>().ok()
    };
    threads.filter_map(ran).sum()
}
