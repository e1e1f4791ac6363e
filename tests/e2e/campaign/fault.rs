//! What is done to the robot, what has to follow, and within which time.

use super::stage::Times;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::fmt;
use std::ops::RangeInclusive;
use std::time::Duration;

/// What a fault hits. Two of a pair hit different things.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Victim {
    Program,
    Body,
    Wormhole,
    Clock,
    Network,
    Launch,
}

/// One fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    ProgramKilled,
    ProgramStopped,
    /// The parameter `mischief` of the program gets this value.
    Mischief(&'static str),
    /// The parameter `scanner` of the body gets this value.
    Scanner(&'static str),
    BodyKilled,
    BodyStopped,
    WormholeKilled,
    WormholeStopped,
    /// The wall clock is set by so many seconds: more than a day, so that launch takes it for set.
    ClockSet(i64),
    LaunchKilled,
    /// The router of this node, by its place.
    RouterKilled(usize),
    /// All processes of the program's computer.
    NodeKilled,
    LinkCut,
}

/// Each fault once.
pub(super) const FAULTS: [Fault; 25] = [
    Fault::ProgramKilled,
    Fault::Mischief("ahead"),
    Fault::WormholeKilled,
    Fault::Scanner("frozen"),
    Fault::WormholeStopped,
    Fault::Mischief("spin"),
    Fault::LinkCut,
    Fault::LaunchKilled,
    Fault::Mischief("backward"),
    Fault::BodyKilled,
    Fault::ProgramStopped,
    Fault::NodeKilled,
    Fault::ClockSet(172_800),
    Fault::Mischief("flood"),
    Fault::Scanner("dead"),
    Fault::Mischief("not-a-number"),
    Fault::Mischief("far"),
    Fault::RouterKilled(0),
    Fault::Scanner("blind"),
    Fault::BodyStopped,
    Fault::Mischief("past"),
    Fault::Mischief("again"),
    Fault::ClockSet(-172_800),
    Fault::Mischief("regress"),
    Fault::RouterKilled(1),
];

impl Fault {
    pub(super) fn victim(self) -> Victim {
        match self {
            Self::ProgramKilled | Self::ProgramStopped | Self::Mischief(_) => Victim::Program,
            Self::Scanner(_) | Self::BodyKilled | Self::BodyStopped => Victim::Body,
            Self::WormholeKilled | Self::WormholeStopped => Victim::Wormhole,
            Self::ClockSet(_) => Victim::Clock,
            Self::RouterKilled(_) | Self::NodeKilled | Self::LinkCut => Victim::Network,
            Self::LaunchKilled => Victim::Launch,
        }
    }

    /// Control is lost within this time. `None`: it need not be lost.
    pub(super) fn lost_within(self, times: &Times) -> Option<Duration> {
        match self {
            Self::ProgramKilled
            | Self::ProgramStopped
            | Self::LaunchKilled
            | Self::NodeKilled
            | Self::LinkCut
            | Self::Mischief("spin" | "not-a-number" | "past" | "again") => Some(times.promise + times.look),
            Self::Mischief("far") => Some(times.horizon + times.look),
            Self::Scanner("dead" | "blind") | Self::BodyStopped => {
                Some(times.scan_age + times.scan_period + times.look)
            }
            Self::WormholeKilled | Self::WormholeStopped => Some(times.look),
            // A robot that stands sees the same again and again, a clock may be set between two scans, and the next
            // body or router may be there before the last scan is old, or the last promise.
            Self::Mischief(_) | Self::Scanner(_) | Self::ClockSet(_) | Self::BodyKilled | Self::RouterKilled(_) => None,
        }
    }

    /// How long after the fault its cause is taken away; what supervision ends itself is left to it.
    pub(super) fn lasts(self, times: &Times) -> Duration {
        match self {
            Self::Mischief("ahead" | "backward" | "flood" | "regress") => times.horizon + times.promise,
            Self::Mischief("far") => times.horizon + times.wait + times.promise,
            Self::Mischief(_) => 2 * times.promise + times.wait,
            Self::Scanner(_) => 2 * times.scan_age,
            Self::ClockSet(_) => times.scan_age,
            Self::BodyStopped => 2 * times.dead_man,
            Self::LinkCut => times.horizon,
            // The motor's dead-man time alone stops the robot.
            Self::WormholeStopped => times.horizon,
            _ => Duration::ZERO,
        }
    }

    /// Within this time after its cause was taken away control is there again.
    pub(super) fn regained_within(self, times: &Times) -> Duration {
        // Between promises a program waits for a scan, and two promises give control.
        let tried = times.scan_age + 3 * times.scan_period + times.look;
        let ended = match self {
            // Launch sees a death at once.
            Self::ProgramKilled | Self::BodyKilled | Self::WormholeKilled | Self::LaunchKilled => Duration::ZERO,
            // Meanwhile the program kept no promise, so that it may be restarted too.
            Self::RouterKilled(_) | Self::NodeKilled | Self::LinkCut => {
                times.routers + times.wait + times.pause + times.start
            }
            // By the wormhole, or, if that is a new one that knows nothing of the program, by launch's watchdog.
            Self::ProgramStopped | Self::Mischief("spin") => times.promise + times.wait.max(times.watchdog),
            Self::Mischief(_) | Self::WormholeStopped => times.promise + times.wait,
            Self::Scanner(_) | Self::ClockSet(_) | Self::BodyStopped => return tried,
        };
        ended + times.pause + times.start + tried
    }

    /// How often the program is restarted for it.
    pub(super) fn restarts(self) -> RangeInclusive<u32> {
        match self {
            Self::ProgramKilled
            | Self::ProgramStopped
            | Self::Mischief("spin" | "not-a-number" | "past" | "again" | "far") => 1..=1,
            Self::WormholeStopped
            | Self::Mischief("regress")
            | Self::RouterKilled(_)
            | Self::LinkCut
            | Self::NodeKilled => 0..=1,
            _ => 0..=0,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ProgramKilled => f.write_str("program killed"),
            Self::ProgramStopped => f.write_str("program stopped"),
            Self::Mischief(how) => write!(f, "program: {how}"),
            Self::Scanner(how) => write!(f, "scanner: {how}"),
            Self::BodyKilled => f.write_str("body killed"),
            Self::BodyStopped => f.write_str("body stopped"),
            Self::WormholeKilled => f.write_str("wormhole killed"),
            Self::WormholeStopped => f.write_str("wormhole stopped"),
            Self::ClockSet(by_s) => write!(f, "clock set by {by_s} s"),
            Self::LaunchKilled => f.write_str("launch killed"),
            Self::RouterKilled(node) => write!(f, "router.{node} killed"),
            Self::NodeKilled => f.write_str("the program's computer killed"),
            Self::LinkCut => f.write_str("link cut"),
        }
    }
}

/// All that one run does to the robot, drawn from a seed.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) seed: u64,
    /// The faults, and how long after the robot drives each comes, in order.
    pub(super) faults: Vec<(Duration, Fault)>,
    /// For what else is drawn.
    pub(super) random: ChaCha8Rng,
}

impl Plan {
    /// Runs of neighbouring seeds begin with different faults. Every second run has a pair.
    pub(super) fn draw(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let first = FAULTS[(seed % FAULTS.len() as u64) as usize];
        let at = Duration::from_millis(300 + below(&mut random, 1700));
        let mut faults = vec![(at, first)];
        if (seed / FAULTS.len() as u64 + seed) % 2 == 1 {
            let others: Vec<Fault> = FAULTS.into_iter().filter(|fault| fault.victim() != first.victim()).collect();
            let second = others[below(&mut random, others.len() as u64) as usize];
            let second_at = at + Duration::from_millis(below(&mut random, 400));
            // A robot without launch takes no orders, nor does a computer that is dead.
            let is_last = first.victim() == Victim::Launch || first == Fault::NodeKilled;
            faults =
                if is_last { vec![(at, second), (second_at, first)] } else { vec![(at, first), (second_at, second)] };
        }
        Self { seed, faults, random }
    }

    pub(super) fn is_pair(&self) -> bool {
        self.faults.len() > 1
    }

    /// Whether the program drives at full speed without a look.
    pub(super) fn drives_on(&self) -> bool {
        let drives = |fault: &Fault| matches!(fault, Fault::Mischief("ahead" | "backward" | "flood" | "again"));
        self.faults.iter().any(|(_, fault)| drives(fault))
    }

    pub(super) fn has(&self, victim: Victim) -> bool {
        self.faults.iter().any(|(_, fault)| fault.victim() == victim)
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "seed {}:", self.seed)?;
        for (index, (at, fault)) in self.faults.iter().enumerate() {
            write!(f, "{} {fault} at {:.2} s", if index == 0 { "" } else { "," }, at.as_secs_f64())?;
        }
        write!(f, " (again: cargo xtask campaign --runs 1 --seed {})", self.seed)
    }
}

/// A number below this one.
pub(super) fn below(random: &mut ChaCha8Rng, end: u64) -> u64 {
    random.next_u64() % end.max(1)
}
