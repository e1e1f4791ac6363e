//! What the turns of a case share: a network of its own, and two nodes with their routers.

use crate::lan::Wire;
use crate::lan::nodes::{Network, Nodes};
use crate::lan::udp::Datagrams;
use rohrpost_bench_local::harness::{Cell, Failure, time_two_processes};
use rohrpost_bench_local::settings::Settings;
use std::cell::Cell as Counter;

/// The largest possible datagram, so that nothing is fragmented.
pub(super) const WHOLE: u16 = u16::MAX;

/// What all turns of a case share.
pub(in crate::cases) struct LanSegment {
    /// None if the system allows no namespaces.
    wire: Result<Wire, Failure>,
    /// None without the command, or if it does not start: then only the floors have figures.
    nodes: Result<Nodes, Failure>,
    turns: Counter<u8>,
}

impl LanSegment {
    /// Makes the network and starts the routers.
    pub(in crate::cases) fn new(settings: &Settings, network: &Network) -> Self {
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

    /// One way from module to module, µs.
    pub(in crate::cases) fn time(&self, cell: &Cell) -> Result<Vec<f64>, Failure> {
        let (nodes, turn) = self.turn()?;
        time_two_processes(cell, |end, meetings| nodes.module(end, turn, cell.bytes, meetings))
    }

    /// One way from socket to socket, µs.
    pub(super) fn time_udp(&self, cell: &Cell) -> Result<Vec<f64>, Failure> {
        time_two_processes(cell, |end, _| Datagrams::open(self.wire()?, end))
    }
}
