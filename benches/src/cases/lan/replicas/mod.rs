//! Replicas: how many records go in a second, how long a pose takes, and what the readers of one replica cost the wire.

mod hop;
mod rate;
mod readers;

use super::ground;
use super::rates;
use crate::cases::Case;
use crate::lan::nodes::{Network, UNPACED};
use rohrpost_mailbox::StreamShape;

/// All cases of this folder.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    [rate::cases(), hop::cases(), readers::cases()].into_iter().flatten().collect()
}

/// An Ethernet whose routers do not pace, with these streams.
fn ethernet(records: StreamShape) -> Network {
    Network { mtu: ground::ETHERNET, rate: UNPACED, quota: "1 MiB", sealed: false, records: Some(records) }
}
