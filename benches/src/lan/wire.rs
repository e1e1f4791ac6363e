//! The network between the two ends of a case: a namespace for each, joined by a bridge.

use rohrpost_bench_local::harness::{End, Failure};
use rohrpost_routers::lab::{Lab, LabError, NodeSpec, become_able};
use std::net::{IpAddr, Ipv4Addr};

/// The address of each end. Freed with the last process that uses it.
pub struct Wire {
    lab: Lab,
}

impl Wire {
    /// Makes it; `mtu` is the largest packet of its links, bytes.
    ///
    /// # Errors
    /// [`Failure::Skipped`] when the system allows no namespaces.
    pub fn new(mtu: u16) -> Result<Self, Failure> {
        Self::of(&[node(End::Ping), node(End::Pong)], mtu)
    }

    /// The same with a third computer on it, which is no node.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_stranger(mtu: u16) -> Result<Self, Failure> {
        let stranger = NodeSpec { name: STRANGER.into(), address: Ipv4Addr::new(10, 117, 0, 3).into() };
        Self::of(&[node(End::Ping), node(End::Pong), stranger], mtu)
    }

    fn of(nodes: &[NodeSpec], mtu: u16) -> Result<Self, Failure> {
        Lab::new(nodes, mtu).map(|lab| Self { lab }).map_err(failure)
    }

    /// Moves the calling process to the third computer for good.
    ///
    /// # Errors
    /// When it may not.
    pub fn enter_stranger(&self) -> Result<(), Failure> {
        self.go(STRANGER)
    }

    /// Moves the calling process to this end for good: what it opens and starts from now on is there.
    ///
    /// # Errors
    /// When it may not.
    pub fn enter(&self, end: End) -> Result<(), Failure> {
        self.go(end.node())
    }

    fn go(&self, place: &str) -> Result<(), Failure> {
        // Dropped, it would lead out again.
        self.lab.enter(place).map(std::mem::forget).map_err(failure)
    }
}

fn node(end: End) -> NodeSpec {
    NodeSpec { name: end.node().into(), address: address(end) }
}

/// The third computer.
const STRANGER: &str = "stranger";

/// Lets this process make such networks, also without root. Call it first in `main`; if it is refused, the cases say
/// so.
pub fn prepare() {
    let _ = become_able();
}

/// As a case has to say it.
pub(crate) fn failure(error: LabError) -> Failure {
    match error {
        LabError::NotAllowed(_) => Failure::Skipped(format!("no namespaces here: {error}")),
        error => Failure::of("network", error),
    }
}

/// Of an end.
pub fn address(end: End) -> IpAddr {
    Ipv4Addr::new(10, 117, 0, if end == End::Ping { 1 } else { 2 }).into()
}
