//! What turns of all programs have in common.

use rohrpost_bench_local::harness::{Cell, Pause, Placement, Scheduling};
use rohrpost_bench_local::settings::Settings;
use std::time::Duration;

/// Of each message.
pub(super) const BYTES: usize = 64;
/// Round trips of a turn, and those before them that do not count.
const MESSAGES: usize = 10_000;
const WARM_UP: usize = 1_000;
/// All wait asleep, so the kernel's fair server stays out; see [`Cell::cap`].
const CAP: Duration = Duration::from_secs(2);

/// A turn of contenders that sleep, on two processors.
pub(super) fn cell(settings: &Settings) -> Cell {
    Cell {
        bytes: BYTES,
        messages: settings.count(MESSAGES),
        warm_up: settings.count(WARM_UP).min(MESSAGES / 10),
        placement: Placement::TwoCores,
        scheduling: Scheduling::Fifo,
        pause: Pause::UNTIL_ASLEEP,
        cap: CAP,
    }
}
