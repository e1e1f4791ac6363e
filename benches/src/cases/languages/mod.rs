//! Programs in C and in Python, beside the same in Rust and beside what else could be used.

mod c;
mod python;
mod remote;

use super::Case;
use crate::harness::{Cell, Placement, Scheduling};
use crate::rounds::{Target, Versus};
use crate::settings::Settings;
use std::time::Duration;

/// Of each message.
const BYTES: usize = 64;
/// Round trips of a turn, and those before them that do not count.
const MESSAGES: usize = 10_000;
const WARM_UP: usize = 1_000;
/// All wait asleep, so the kernel's fair server stays out; see [`Cell::cap`].
const CAP: Duration = Duration::from_secs(2);

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Box<dyn Case>> {
    [c::cases(), python::cases(), remote::cases()].into_iter().flatten().collect()
}

/// A turn of contenders that sleep, on two processors.
fn cell(settings: &Settings) -> Cell {
    Cell {
        bytes: BYTES,
        messages: settings.count(MESSAGES),
        warm_up: settings.count(WARM_UP).min(MESSAGES / 10),
        placement: Placement::TwoCores,
        scheduling: Scheduling::Fifo,
        pace: None,
        cap: CAP,
    }
}

fn at_most(name: &'static str, bound: f64) -> Versus {
    Versus { name, p50: Some(Target::AtMost(bound)), p99: None }
}
