//! How late after a missed deadline the motor has the command to brake, while a busy loop at normal priority keeps each
//! processor. Beside it a thread that sleeps until a moment and then sends one package: no supervisor that is a process
//! of its own is earlier.

use super::hop::hops;
use super::robot::{Program, SupervisedTurn, turn, wait_until};
use crate::cases::errors::Done;
use crate::lan::load::busy_loop;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Child, End, Failure, processors};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::monotonic_ns;
use std::time::Duration;

/// Deadlines of a turn.
const DEADLINES: usize = 400;
/// Length of the promise that is not kept: longer than it takes until its command is at the motor.
const LENGTH: Duration = Duration::from_millis(20);
/// A computer that halts a process for longer than the promise makes it late, and this round does not count.
const TRIES: usize = 20;

/// What the program does until its deadline is over.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Meanwhile {
    Silent,
    /// Sends promises that the wormhole refuses, as fast as it can.
    Floods,
}

/// The cases of this file.
pub(super) fn cases() -> [Case; 2] {
    let quiet = Case::new("deadline to the brake", None, "us", |settings, subject| {
        let deadlines = settings.count(DEADLINES);
        let ours = Contender::sampled("rohrpost", || brakes(settings, deadlines, Meanwhile::Silent));
        let floor =
            Contender::sampled("timer and hop", || beside_load(|| hops(deadlines, End::Pong, sleep_to_deadline)));
        Ok(compare(settings, subject, &[ours, floor.beside(None, at_most(1.3))]))
    });
    let flooded = Case::new("deadline to the brake, flooded", None, "us", |settings, subject| {
        let deadlines = settings.count(DEADLINES);
        let ours = Contender::sampled("rohrpost", || brakes(settings, deadlines, Meanwhile::Floods));
        let quiet = Contender::sampled("not flooded", || brakes(settings, deadlines, Meanwhile::Silent));
        Ok(compare(settings, subject, &[ours, quiet.beside(None, at_most(1.5))]))
    });
    [quiet, flooded]
}

fn beside_load<T>(turn: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    let _load = processors().iter().map(|_| busy_loop()).collect::<Result<Vec<Child>, Failure>>()?;
    turn()
}

/// Sleeps as long as a promise is, and gives the moment at which that was over.
fn sleep_to_deadline() -> u64 {
    let due_ns = monotonic_ns() + LENGTH.as_nanos() as u64;
    std::thread::sleep(LENGTH);
    due_ns
}

fn brakes(settings: &Settings, deadlines: usize, meanwhile: Meanwhile) -> Result<Vec<f64>, Failure> {
    let drive = |program: &mut Program, turn: &SupervisedTurn| {
        let mut tries = 0;
        while turn.len() < deadlines {
            let before = turn.len();
            let missed = miss_deadline(program, turn, meanwhile);
            tries = if turn.len() > before { 0 } else { tries + 1 };
            if tries == TRIES {
                missed?;
                return Err("the wormhole does not let its program drive".into());
            }
            program.reset()?;
        }
        Ok(())
    };
    beside_load(|| turn(settings, drive))
}

/// Gains control, and loses it by a deadline.
fn miss_deadline(program: &mut Program, turn: &SupervisedTurn, meanwhile: Meanwhile) -> Done<()> {
    // The first one is tried only.
    program.promise(LENGTH)?;
    let number = program.next();
    let deadline_ns = monotonic_ns() + LENGTH.as_nanos() as u64;
    program.keep(number, LENGTH)?;
    let is_over = || monotonic_ns() >= deadline_ns;
    let has_it = wait_until(|| turn.driven() == number || is_over());
    turn.await_command(0, deadline_ns);
    if !has_it || is_over() {
        turn.await_nothing();
        return Ok(());
    }
    if meanwhile == Meanwhile::Floods {
        while !turn.has_come() {
            program.send_nonsense(LENGTH);
        }
    }
    if wait_until(|| turn.has_come()) {
        return Ok(());
    }
    turn.await_nothing();
    Err("no brake came to the motor".into())
}
