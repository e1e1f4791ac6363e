//! The masters of time, as seen on the bridge: from when to when. The demo has the keys of sealed time datagrams, and
//! reads them like a node that has not authenticated its peers.

use crate::terminal::Failure;
use rohrpost_config::Installation;
use rohrpost_router_daemon::keys;
use rohrpost_routers::frame::{FrameHead, NodeIndex};
use rohrpost_routers::lab::Crossing;
use rohrpost_routers::security::{Opening, PeerSessions, Port, RouterIdentity, TAG_BYTES};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::time::message::{Sync, TimeMessage};
use rohrpost_routers::time::{TIME_BYTES, Term};
use std::collections::VecDeque;

/// The incarnation of an observer that sends nothing.
const MUTE: u64 = 1;

/// By node: opens what is sealed to it. Empty where nothing is sealed.
#[derive(Default)]
pub(super) struct SealedCapture {
    nodes: Vec<Opening>,
}

impl SealedCapture {
    /// With the LAN keys of an installation, if it has some.
    pub(super) fn of(installation: &Installation) -> Result<Self, Failure> {
        let mut nodes = Vec::new();
        for node in installation.lan_nodes() {
            let Some(keys) = keys::of(installation)? else { break };
            let settings = Settings::new(installation, &node.name, MUTE)?;
            nodes.push(Opening::new(&PeerSessions::new(RouterIdentity::of(&settings), keys), Port::Time));
        }
        Ok(Self { nodes })
    }

    /// Parses a datagram of time, sealed or not.
    pub(super) fn hear(&mut self, datagram: &[u8]) -> Option<(FrameHead, TimeMessage)> {
        if let Ok((head, rest)) = FrameHead::parse(datagram) {
            return Some((head, TimeMessage::parse(head.kind, rest).ok()?));
        }
        let mut sealed = [0; TIME_BYTES + TAG_BYTES];
        sealed.copy_from_slice(datagram.get(..TIME_BYTES + TAG_BYTES).filter(|whole| whole.len() == datagram.len())?);
        let ear = (0..self.nodes.len()).find(|node| self.nodes[*node].is_strange(&sealed))?;
        let (head, rest) = self.nodes[ear].overhear(&mut sealed, |_| true).ok()?;
        Some((head, TimeMessage::parse(head.kind, rest).ok()?))
    }
}

/// The oldest are dropped first. On a busy computer, a master leaves out about one cycle in some hundred.
const TERMS_MAX: usize = 10_000;

/// Consecutive cycles of one master.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct MasterTerm {
    pub(super) node: NodeIndex,
    term: Term,
    /// When its first frame crossed the bridge, monotonic ns.
    pub(super) first_ns: u64,
    pub(super) first_cycle: u64,
    pub(super) last_ns: u64,
    pub(super) last_cycle: u64,
}

/// All terms, in order.
#[derive(Default)]
pub(super) struct Masters {
    capture: SealedCapture,
    list: VecDeque<MasterTerm>,
}

impl Masters {
    /// No node has sent the time yet.
    pub(super) fn heard_with(capture: SealedCapture) -> Self {
        Self { capture, ..Self::default() }
    }

    /// Records a datagram, if it is a master's of time. A backup that stands in for a master is none.
    pub(super) fn note(&mut self, crossing: &Crossing<'_>) {
        if let Some((head, TimeMessage::Sync(sync))) = self.capture.hear(crossing.datagram)
            && !sync.replacement
        {
            self.told(head.from, crossing.at_ns, &sync);
        }
    }

    fn told(&mut self, node: NodeIndex, at_ns: u64, sync: &Sync) {
        let Sync { cycle, term, .. } = *sync;
        let goes_on = |last: &&mut MasterTerm| {
            (last.node, last.term) == (node, term) && (last.last_cycle..=last.last_cycle + 1).contains(&cycle)
        };
        if let Some(last) = self.list.back_mut().filter(goes_on) {
            (last.last_ns, last.last_cycle) = (at_ns, cycle);
            return;
        }
        if self.list.len() == TERMS_MAX {
            self.list.pop_front();
        }
        let (first_ns, last_ns, first_cycle, last_cycle) = (at_ns, at_ns, cycle, cycle);
        self.list.push_back(MasterTerm { node, term, first_ns, first_cycle, last_ns, last_cycle });
    }

    /// The last term that began before this moment.
    pub(super) fn master_at(&self, at_ns: u64) -> Option<&MasterTerm> {
        self.list.iter().rev().find(|term| term.first_ns <= at_ns)
    }

    /// This node's last term that began before this moment.
    pub(super) fn last_of(&self, node: usize, at_ns: u64) -> Option<&MasterTerm> {
        self.list.iter().rev().find(|term| usize::from(term.node) == node && term.first_ns <= at_ns)
    }

    /// The first term that began after this moment.
    pub(super) fn next_after(&self, at_ns: u64) -> Option<&MasterTerm> {
        self.list.iter().find(|term| term.first_ns > at_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_term_ends_with_another_node_or_a_missing_cycle() {
        let mut masters = Masters::default();
        for (node, cycle) in [(0, 1), (0, 1), (0, 2), (1, 5), (1, 7)] {
            masters.told(node, cycle * 1000, &Sync { cycle, term: Term::new(1, 0), ..Sync::default() });
        }
        let seen: Vec<_> = masters.list.iter().map(|term| (term.node, term.first_cycle, term.last_cycle)).collect();
        assert_eq!(seen, [(0, 1, 2), (1, 5, 5), (1, 7, 7)]);
        assert_eq!(masters.master_at(4999).map(|term| term.node), Some(0));
        assert_eq!(masters.master_at(5000).map(|term| term.node), Some(1));
        assert_eq!(masters.master_at(999), None);
        assert_eq!(masters.last_of(0, 9000).map(|term| term.last_cycle), Some(2));
        assert_eq!(masters.last_of(1, 4999), None);
        assert_eq!(masters.next_after(2000).map(|term| term.first_cycle), Some(5));
    }
}
