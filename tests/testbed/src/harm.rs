//! What the router of an intruder does for it.

use rohrpost_routers::broken::{Broken, with};

/// Runs something as a router does that lets its programs hurry as they like, if it `does_harm`.
pub(crate) fn harmful<R>(does_harm: bool, run: impl FnOnce() -> R) -> R {
    if does_harm { with(Broken::Hurries, run) } else { run() }
}
