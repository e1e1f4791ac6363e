//! What the turns of a case share: a network of its own, and two nodes with their routers.

use crate::lan::Wire;
use crate::lan::nodes::{Network, Nodes, UNPACED};
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::StreamShape;
use std::cell::Cell as Counter;

/// The largest possible datagram, so that nothing is fragmented.
pub(super) const WHOLE: u16 = u16::MAX;
/// Of a current Ethernet.
pub(super) const ETHERNET: u16 = 1_500;

/// An Ethernet with routers that do not pace. Each node has a replica of the other's stream.
pub(super) fn replicating(records: StreamShape) -> Network {
    Network { mtu: ETHERNET, rate: UNPACED, quota: "1 MiB", sealed: false, records: Some(records) }
}

/// What all turns of a case share.
pub(super) struct LanSegment {
    /// None if the system allows no namespaces.
    wire: Result<Wire, Failure>,
    /// None without the command, or if it does not start: then only the floors have figures.
    nodes: Result<Nodes, Failure>,
    turns: Counter<u8>,
}

impl LanSegment {
    /// Makes the network and starts the routers.
    pub(super) fn new(settings: &Settings, network: &Network) -> Self {
        Self::on(settings, network, Wire::new(network.mtu))
    }

    /// As [`Self::new`], on an existing network.
    pub(super) fn on(settings: &Settings, network: &Network, wire: Result<Wire, Failure>) -> Self {
        let nodes =
            wire.as_ref().map_err(Clone::clone).and_then(|wire| Nodes::start(wire, network, settings.command()));
        Self { wire, nodes, turns: Counter::new(0) }
    }

    pub(super) fn wire(&self) -> Result<&Wire, Failure> {
        self.wire.as_ref().map_err(Clone::clone)
    }

    /// For one of our turns: the nodes, and its number.
    pub(super) fn turn(&self) -> Result<(&Nodes, u8), Failure> {
        let turn = self.turns.get();
        self.turns.set(turn.wrapping_add(1));
        Ok((self.nodes.as_ref().map_err(Clone::clone)?, turn))
    }
}
