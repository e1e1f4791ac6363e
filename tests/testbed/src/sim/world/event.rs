//! What happens in a world.

use crate::sim::station::{Arrived, Port};
use rohrpost_mailbox::Name;

/// What happens.
pub(in crate::sim) enum Event {
    /// A router has something to do.
    Wake { node: usize },
    /// A datagram comes out of a link.
    Arrive { to: usize, arrived: Arrived },
    /// An old one comes once more; if it is for that incarnation, not to another.
    Again { to: usize, life: Option<u32>, arrived: Arrived },
    /// The kernel says when a datagram left.
    Left { node: usize, life: u32, port: Port, index: u64 },
    /// A router starts if nothing keeps it down.
    Start { node: usize },
    /// A fault of the plan begins.
    Begin { fault: usize },
    /// It is over.
    End { fault: usize },
    /// All faults are over.
    Fixed,
    /// The next package of a flow, or the next of its burst.
    Flow { flow: usize },
    /// The next record of a stream.
    Write { stream: usize },
    /// A reader of a replica looks what there is.
    Read { reader: usize },
    /// The next call of a caller.
    Call { caller: usize },
    /// The next try of a call.
    Try { call: usize },
    /// A module takes its next command.
    Serve { node: usize, module: Name },
    /// A launch has something to do about leases.
    Launch { node: usize },
    /// The holder of a lease publishes, in this life of its launch.
    Publish { node: usize, run: u32 },
    /// All is looked at; clocks wander.
    SnapshotRequest,
}
