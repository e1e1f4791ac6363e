//! One turn at a time: two that spin at real-time priority on the same processors would wait for each other's ends.

use super::{Failure, OrFail, interrupted};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::time::Duration;

/// An abstract name, which is free again when its holder is gone, however it went.
const NAME: &str = "rohrpost-bench";

/// How often a bench that waits looks: often enough to come in between two turns of another.
const LOOK_EACH: Duration = Duration::from_millis(10);

/// Held during a turn.
pub struct Alone {
    _name: UnixListener,
}

/// Waits until no other bench on this computer has a turn.
///
/// # Errors
/// When it was interrupted meanwhile, or there are no such names.
pub fn alone() -> Result<Alone, Failure> {
    let name = SocketAddr::from_abstract_name(NAME).or_fail(NAME)?;
    loop {
        match UnixListener::bind_addr(&name) {
            Ok(listener) => return Ok(Alone { _name: listener }),
            Err(error) if error.kind() != std::io::ErrorKind::AddrInUse => return Err(Failure::of(NAME, error)),
            Err(_) if interrupted() => return Err(Failure::Failed("interrupted".into())),
            Err(_) => std::thread::sleep(LOOK_EACH),
        }
    }
}
