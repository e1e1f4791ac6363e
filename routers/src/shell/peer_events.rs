//! Messages of a router about its peers: each once, until it is over.

use super::failure::Failure;
use crate::frame::{self, NodeIndex, RefusalReason};
use crate::report::{Mismatch, RouterEvent};
use crate::settings::Settings;
use std::sync::Arc;

/// The difference between two nodes that refuse each other, and the remedy. `digest` is this node's.
pub fn difference(mismatch: &Mismatch, digest: u64) -> String {
    match (mismatch.reason, mismatch.digest) {
        (RefusalReason::Version, _) => format!(
            "it speaks wire format {}, this one {}; run the same version of Rohrpost on all nodes (`rohrpost version`)",
            mismatch.version,
            frame::VERSION
        ),
        (RefusalReason::Digest, Some(theirs)) => format!(
            "its configuration has the digest {theirs:016x}, this node's {digest:016x}; launch all nodes from the same \
             file (`rohrpost check`, on both)"
        ),
        (RefusalReason::Digest, None) => {
            format!("its configuration is another than this node's, {digest:016x}; launch all nodes from the same file")
        }
        (RefusalReason::Sealed, _) => {
            "one of both seals what it sends (`security = \"keys\"`), the other does not (`security = \"none\"`); \
             launch all nodes from the same file"
                .into()
        }
        (RefusalReason::Key, _) => {
            "what comes from its address is sealed with another key than this node's; copy the folder \
                             of keys from the first computer of the installation to this one or to that (`rohrpost \
                             keys show`, on both, tells which differ)"
                .into()
        }
        (RefusalReason::Stranger, _) => {
            "its packages come from another address than the configuration has for it, or are for another \
             node; correct `address` in the configuration, and launch all nodes from it"
                .into()
        }
    }
}

/// Reports about peers by their names.
pub(super) struct News {
    settings: Arc<Settings>,
    /// For each peer: why nothing could be sent there.
    failing: Box<[Option<Failure>]>,
}

impl News {
    pub(super) fn new(settings: &Arc<Settings>) -> Self {
        Self { settings: settings.clone(), failing: settings.nodes.iter().map(|_| None).collect() }
    }

    /// An event of the receiving half.
    pub(super) fn event(&self, event: RouterEvent) {
        let digest = self.settings.digest;
        match event {
            RouterEvent::Heard { peer } => tracing::info!("{} is heard", self.node(peer)),
            RouterEvent::Restarted { peer } => tracing::info!("the router of {} was started anew", self.node(peer)),
            RouterEvent::Silent { peer } => tracing::warn!(
                "{} is silent: nothing came for a second; is it on, does its router run, and does the network reach \
                 it?",
                self.node(peer)
            ),
            RouterEvent::Unheard { peer } => tracing::warn!(
                "{} is heard, but does not hear this node; is a firewall in between, or a cable half broken?",
                self.node(peer)
            ),
            RouterEvent::Refused { source, peer: None, .. } => {
                tracing::warn!("takes nothing from {source}: the configuration has no node with this address");
            }
            RouterEvent::Refused { peer: Some(peer), mismatch, .. } => {
                tracing::warn!("takes nothing from {}: {}", self.node(peer), difference(&mismatch, digest));
            }
            RouterEvent::Refuses { peer, mismatch } => {
                tracing::warn!("{} takes nothing from this node: {}", self.node(peer), difference(&mismatch, digest));
            }
            RouterEvent::Rejected { source, peer, why, datagrams } => {
                let from = peer.map_or_else(|| format!("{source}, the address of no node"), |peer| self.node(peer));
                tracing::warn!("takes nothing from {from}: {why} (datagrams: {datagrams})");
            }
            RouterEvent::Twice { peer } => tracing::error!(
                "two routers send as {}: its address is used twice, or an old router there did not end; end one of \
                 them",
                self.node(peer)
            ),
        }
    }

    /// A datagram could not be sent.
    #[cold]
    pub(super) fn fails(&mut self, to: NodeIndex, failure: Failure) {
        // That nothing listens is not reported: a peer that does not run is silent, and that is reported.
        if failure.is_loss() && self.failing[usize::from(to)].replace(failure) != Some(failure) {
            tracing::warn!("cannot send to {}: {}", self.node(to), failure.words());
        }
    }

    /// A datagram could be sent.
    pub(super) fn works(&mut self, to: NodeIndex) {
        if self.failing[usize::from(to)].take().is_some() {
            tracing::info!("sends to {} again", self.node(to));
        }
    }

    fn node(&self, peer: NodeIndex) -> String {
        match self.settings.nodes.get(usize::from(peer)) {
            Some(node) => format!("node {} ({})", node.name, node.address),
            None => format!("node number {peer}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_names_both_sides_and_the_remedy() {
        let mismatch = |reason, digest| Mismatch { reason, version: 9, digest };
        for (mismatch, words) in [
            (mismatch(RefusalReason::Version, None), ["wire format 9", "this one 2", "same version of Rohrpost"]),
            (
                mismatch(RefusalReason::Digest, Some(0xab)),
                ["00000000000000ab", "0000000000001234", "from the same file"],
            ),
            (mismatch(RefusalReason::Digest, None), ["another", "0000000000001234", "from the same file"]),
            (mismatch(RefusalReason::Key, None), ["another key", "from the first computer", "keys show"]),
            (mismatch(RefusalReason::Stranger, Some(1)), ["another address", "for it", "correct `address`"]),
        ] {
            let text = difference(&mismatch, 0x1234);
            assert!(words.iter().all(|word| text.contains(word)), "{text}");
        }
    }
}
