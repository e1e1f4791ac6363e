//! Two nodes on a network of their own: how long a package takes over two routers, how many go, what is urgent past a flood.

mod clock;
mod hop;
mod junk;
mod rates;
mod sealed;
mod urgent;

use super::Case;
use crate::harness::Failure;
use crate::lan::Wire;
use crate::lan::nodes::{Network, Nodes};
use crate::settings::Settings;
use std::cell::Cell as Counter;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Box<dyn Case>> {
    [hop::cases(), sealed::cases(), rates::cases(), urgent::cases(), junk::cases(), clock::cases()]
        .into_iter()
        .flatten()
        .collect()
}

/// As large as a datagram can be, so that none is parted.
const WHOLE: u16 = u16::MAX;

/// What all turns of a case happen on.
struct Ground {
    /// None where there may be no namespaces.
    wire: Result<Wire, Failure>,
    /// None where there is no command, or it does not start: then ours has no figure, and the floors still have.
    nodes: Result<Nodes, Failure>,
    turns: Counter<u8>,
}

impl Ground {
    /// Makes the network and starts the routers.
    fn new(settings: &Settings, network: &Network) -> Self {
        Self::on(settings, network, Wire::new(network.mtu))
    }

    /// The same on a network that is there.
    fn on(settings: &Settings, network: &Network, wire: Result<Wire, Failure>) -> Self {
        let nodes =
            wire.as_ref().map_err(Clone::clone).and_then(|wire| Nodes::start(wire, network, settings.command()));
        Self { wire, nodes, turns: Counter::new(0) }
    }

    fn wire(&self) -> Result<&Wire, Failure> {
        self.wire.as_ref().map_err(Clone::clone)
    }

    /// For a turn of ours: the nodes, and its number.
    fn turn(&self) -> Result<(&Nodes, u8), Failure> {
        let turn = self.turns.get();
        self.turns.set(turn.wrapping_add(1));
        Ok((self.nodes.as_ref().map_err(Clone::clone)?, turn))
    }
}
