//! What a hop over two routers costs at least: from futex to UDP and from UDP to futex, and nothing looked at on the way.
//!
//! ```text
//!  ping ──futex──▶ relay ══UDP══▶ relay ──futex──▶ pong
//!  ping ◀──futex── relay ◀══UDP══ relay ◀──futex── pong
//! ```
//! Each relay is a process and carries one direction, so that none ever waits for two things at once.

use super::Wire;
use super::udp::Datagrams;
use crate::floors::{HandOver, Lanes, Wake};
use crate::harness::{Cell, Child, End, Failure, Gate, Link, Shared, settle, time_two_processes};

/// From the near end to the far one, and back.
const PORTS: [u16; 2] = [20_118, 20_119];

/// Times the chain; see [`time_two_processes`].
///
/// # Errors
/// What a relay failed with, else an end.
pub fn time_chain(wire: &Wire, cell: &Cell) -> Result<Vec<f64>, Failure> {
    let nodes = [Shared::<Lanes>::new()?, Shared::<Lanes>::new()?];
    let at = |end| &nodes[usize::from(end == End::Pong)];
    let mut relays = Relays::start(wire, cell, at)?;
    // On its node the module is the near side of the lanes, the relays are the far one.
    let timed = time_two_processes(cell, |end, _| Ok(HandOver::new(at(end), End::Ping, Wake::Futex)));
    relays.check()?;
    timed
}

/// All four, until this is dropped.
struct Relays(Vec<Child>);

impl Relays {
    fn start<'a>(wire: &Wire, cell: &Cell, at: impl Fn(End) -> &'a Shared<Lanes>) -> Result<Self, Failure> {
        let gate = Shared::<Gate>::new()?;
        let mut relays = Self(Vec::new());
        for (end, outgoing) in [(End::Ping, true), (End::Ping, false), (End::Pong, true), (End::Pong, false)] {
            let relay = Child::start(|| {
                // Its own port for each direction: the one that only sends must not take what comes.
                let there = outgoing == (end == End::Ping);
                let port = PORTS[usize::from(!there)];
                let mut network = Datagrams::between(wire, end, [port, port])?;
                let mut local = HandOver::new(at(end), End::Pong, Wake::Futex);
                settle(end, cell.placement, cell.scheduling)?;
                gate.meet(5)?;
                let mut message = vec![0; cell.bytes];
                loop {
                    if outgoing {
                        local.receive(&mut message)?;
                        network.send(&message)?;
                    } else {
                        network.receive(&mut message)?;
                        local.send(&message)?;
                    }
                }
            })?;
            relays.0.push(relay);
        }
        // One that fails before it meets says why in `check`.
        if let Err(late) = gate.meet(5) {
            relays.check()?;
            return Err(late);
        }
        Ok(relays)
    }

    /// A relay ends only when it fails.
    fn check(&mut self) -> Result<(), Failure> {
        for mut relay in std::mem::take(&mut self.0) {
            if relay.has_ended()? {
                relay.finish(std::time::Instant::now())?;
            }
        }
        Ok(())
    }
}
