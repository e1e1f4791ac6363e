//! The faults of a demo with chaos, and how they come to the robot.

use crate::launch::LaunchedNodes;
use crate::terminal::Failure;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rohrpost::common::SetParameters;
use rohrpost::interfaces::{ControlMode, ControlState, SupervisorInterface};
use rohrpost::parameter::from_word;
use rohrpost::wire::from_bytes;
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{ModuleState, Node, ParticipantInfo, node_directory};
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The program, the parameter by which it misbehaves, its computers, and the computer of the wormhole.
const PROGRAM: &str = "pilot.0";
const MISCHIEF: &str = "mischief";
const COMPUTERS: [&str; 2] = ["brain", "desk"];
const WORMHOLE: (&str, &str) = ("base", "wormhole.0");
/// The number of `state` in the wormhole's interface.
const STATE: u16 = 23;
/// Timeout for modules' answers.
const PATIENCE: Duration = Duration::from_millis(300);
/// Tries to reach a module that a router has just lost.
const TRIES: u32 = 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Killed,
    Stopped,
    /// The program does something wrong.
    Mischief(&'static str),
    ComputerKilled,
}

/// The computer dies once in each turn of them.
const FAULTS: [Fault; 10] = [
    Fault::ComputerKilled,
    Fault::Killed,
    Fault::Stopped,
    Fault::Mischief("spin"),
    Fault::Mischief("not-a-number"),
    Fault::Mischief("ahead"),
    Fault::Mischief("backward"),
    Fault::Mischief("flood"),
    Fault::Mischief("far"),
    Fault::Mischief("again"),
];

impl Fault {
    /// How long after the fault its cause is taken away, unless supervision has ended the program before.
    pub(super) fn lasts(self) -> Duration {
        match self {
            Self::Killed | Self::Stopped => Duration::ZERO,
            Self::Mischief(_) | Self::ComputerKilled => Duration::from_secs(3),
        }
    }

    /// Whether the program loses control in any case.
    pub(super) fn ends_control(self) -> bool {
        !matches!(self, Self::Mischief("ahead" | "backward" | "flood"))
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Killed => "the program is killed",
            Self::Stopped => "the program is stopped (SIGSTOP)",
            Self::Mischief("spin") => "the program computes without end",
            Self::Mischief("not-a-number") => "the program commands what is no number",
            Self::Mischief("ahead") => "the program drives ahead at full speed",
            Self::Mischief("backward") => "the program drives backward at full speed",
            Self::Mischief("flood") => "the program floods the motor with commands",
            Self::Mischief("far") => "the program promises for weeks and is silent",
            Self::Mischief("again") => "the program sends old promises again",
            Self::Mischief(other) => other,
            Self::ComputerKilled => "the program's computer dies; another takes over",
        })
    }
}

/// Draws faults from a seed: each turn has all of them, the computer's among its first three.
pub(super) struct Draw {
    random: ChaCha8Rng,
    turn: Vec<Fault>,
}

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self { random: ChaCha8Rng::seed_from_u64(seed), turn: Vec::new() }
    }

    pub(super) fn next(&mut self) -> Fault {
        if self.turn.is_empty() {
            let mut others = FAULTS[1..].to_vec();
            while !others.is_empty() {
                let at = self.below(others.len());
                self.turn.push(others.swap_remove(at));
            }
            // The last is the next.
            let at = self.turn.len() - self.below(3);
            self.turn.insert(at, FAULTS[0]);
        }
        self.turn.pop().unwrap_or(FAULTS[0])
    }

    fn below(&mut self, end: usize) -> usize {
        (self.random.next_u64() % end as u64) as usize
    }
}

/// The robot, as a tool on the computer of the wormhole has it.
pub(super) struct Robot {
    installation: Arc<Installation>,
    tool: ToolLink,
    wormhole: Name,
    program: Name,
    control_since: Option<Instant>,
    /// A computer that is dead.
    dead: Option<&'static str>,
}

impl Robot {
    pub(super) fn join(installation: &Arc<Installation>) -> Result<Self, Failure> {
        let (base, wormhole) = WORMHOLE;
        let node = Node::open(&node_directory(&installation.name, base))?;
        let tool = ToolLink::join(installation, &node, base, PATIENCE)?;
        let [wormhole, program] = [wormhole, PROGRAM].map(|module| installation.classes.parse_module(module));
        let (wormhole, program) = (wormhole?, program?);
        Ok(Self { installation: installation.clone(), tool, wormhole, program, control_since: None, dead: None })
    }

    pub(super) fn leave(self) {
        self.tool.close();
    }

    /// Since when the program has control; none while it has not.
    pub(super) fn control_since(&mut self) -> Option<Instant> {
        let read = |bytes: &[u8]| from_bytes::<ControlState>(bytes);
        let state = self.tool.call(self.wormhole, STATE, SupervisorInterface::hash(), |_| Ok(()), read);
        let has_control = state.is_ok_and(|state| state.mode == ControlMode::Active);
        self.control_since = has_control.then(|| self.control_since.unwrap_or_else(Instant::now));
        self.control_since
    }

    pub(super) fn let_happen(&mut self, fault: Fault, nodes: &mut LaunchedNodes<'_>) -> Result<(), Failure> {
        match fault {
            Fault::Killed => self.signal(Signal::SIGKILL),
            Fault::Stopped => self.signal(Signal::SIGSTOP),
            Fault::Mischief(how) => self.tell_program(how),
            Fault::ComputerKilled => {
                let (computer, _) = self.running()?;
                self.dead = Some(computer);
                nodes.kill(computer)
            }
        }
    }

    pub(super) fn repair(&mut self, fault: Fault, nodes: &mut LaunchedNodes<'_>) -> Result<(), Failure> {
        match fault {
            Fault::Killed | Fault::Stopped => Ok(()),
            Fault::Mischief(_) => self.tell_program("nothing"),
            Fault::ComputerKilled => self.dead.take().map_or(Ok(()), |computer| nodes.start_again(computer)),
        }
    }

    fn signal(&self, signal: Signal) -> Result<(), Failure> {
        Ok(kill(self.running()?.1, signal)?)
    }

    /// The computer that runs the program, and its process.
    fn running(&self) -> Result<(&'static str, Pid), Failure> {
        // The other computer has a process of it, too, which stands by.
        let is_program = |participant: &ParticipantInfo| {
            participant.module == self.program && participant.pid != 0 && participant.state == Some(ModuleState::On)
        };
        let on = |computer: &'static str| {
            let node = Node::open(&node_directory(&self.installation.name, computer)).ok()?;
            let program = node.participants().into_iter().find(is_program)?;
            Some((computer, Pid::from_raw(program.pid as i32)))
        };
        let found = COMPUTERS.into_iter().find_map(on);
        Ok(found.ok_or_else(|| format!("{PROGRAM} runs on none of {}", COMPUTERS.join(", ")))?)
    }

    /// Sets how the program misbehaves. One that has just been started is asked again.
    fn tell_program(&mut self, how: &str) -> Result<(), Failure> {
        let mut tried = 1;
        loop {
            match self.set(how) {
                Err(_) if tried < TRIES => tried += 1,
                set => return set,
            }
        }
    }

    fn set(&mut self, how: &str) -> Result<(), Failure> {
        let parameters = self.tool.parameters(self.program)?;
        let parameter = parameters.iter().find(|parameter| parameter.field.name == MISCHIEF);
        let parameter = parameter.ok_or_else(|| format!("{PROGRAM} has no parameter `{MISCHIEF}`"))?;
        let values = vec![(MISCHIEF.to_owned(), from_word(&parameter.field.ty, how)?)];
        self.tool.set_parameters(self.program, &SetParameters { values, only_check: false })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_draws_the_same_faults_again_and_the_computer_dies_early() {
        let of = |seed| {
            let mut draw = Draw::new(seed);
            [(); 20].map(|()| draw.next())
        };
        assert_eq!(of(7), of(7));
        assert_ne!(of(7), of(8));
        for seed in 0..100 {
            let drawn = of(seed);
            assert!(drawn[..3].contains(&Fault::ComputerKilled), "{seed}: {drawn:?}");
            assert!(FAULTS.iter().all(|fault| drawn[..10].contains(fault)), "{seed}: {drawn:?}");
        }
    }
}
