//! How long a promise takes through the wormhole to the motor, beside one package from process to process. Each finds
//! all processes asleep for milliseconds: a robot's program promises a few times in a second.

use super::hop::hops;
use super::robot::{Program, SupervisedTurn, turn, wait_until};
use crate::cases::errors::Done;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::End;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_mailbox::monotonic_ns;
use std::time::Duration;

/// Promises of a turn, and those before them that do not count.
const PROMISES: usize = 1_000;
/// A program that drives promises far more often.
const LENGTH: Duration = Duration::from_secs(1);
/// Silence at the motor before each promise: the wormhole looks at a promise at once if it has sent nothing for 5 ms.
const SILENCE: Duration = Duration::from_millis(6);

/// From the promise's call until the motor has the command.
pub(super) fn case() -> Case {
    Case::new("promise to the motor", None, "us", |settings, subject| {
        let promises = settings.count(PROMISES);
        let ours = Contender::sampled("rohrpost", || turn(settings, |program, turn| drive(program, turn, promises)));
        let hop = Contender::sampled("hop", || {
            hops(promises, End::Ping, || {
                std::thread::sleep(SILENCE);
                monotonic_ns()
            })
        });
        Ok(compare(settings, subject, &[ours, hop.beside(at_most(2.1), at_most(2.3))]))
    })
}

fn drive(program: &mut Program, turn: &SupervisedTurn, promises: usize) -> Done<()> {
    while turn.len() < promises {
        program.scan_if_due()?;
        wait_for_silence(turn);
        let number = program.next();
        turn.await_command(number, monotonic_ns());
        program.keep(number, LENGTH)?;
        if !wait_until(|| turn.has_come()) {
            return Err(format!("promise {number} did not come to the motor").into());
        }
    }
    Ok(())
}

fn wait_for_silence(turn: &SupervisedTurn) {
    loop {
        let silent_ns = monotonic_ns().saturating_sub(turn.command_ns());
        let left = SILENCE.saturating_sub(Duration::from_nanos(silent_ns));
        if left.is_zero() {
            return;
        }
        std::thread::sleep(left);
    }
}
