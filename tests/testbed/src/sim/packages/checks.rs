//! What must hold of a router's packages at any moment: accounts, bounds, what it says of its peers, and that all is
//! well again.

use super::{Packages, STILL_NS};
use crate::sim::promise::Promise;
use crate::sim::station::Io;
use rohrpost_routers::counts::Side;
use rohrpost_routers::fragment::PARTIAL_MAX;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::inbound::TICK_EVERY_NS;
use rohrpost_routers::link::{PeerLinkState, SILENT_AFTER_NS, TELL_EVERY_NS, UNHEARD_AFTER_NS};

/// So long after a datagram came what went before it, and is missing, is counted as lost: at the third tick.
const SETTLED_NS: u64 = 3 * TICK_EVERY_NS + STILL_NS;

/// What all classes of one direction counted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Sums {
    packages: u64,
    passed: u64,
    lost: u64,
}

impl Sums {
    fn of(side: &Side) -> Self {
        side.classes().fold(Self::default(), |sums, (_, class)| Self {
            packages: sums.packages + class.packages.get(),
            passed: sums.passed + class.passed.get(),
            lost: sums.lost + class.lost_in_all(),
        })
    }
}

impl Packages {
    pub(super) fn check_accounts(&self, io: &mut Io<'_>) {
        let account = io.oracle.account(io.life);
        let waiting = self.stats.waiting_in_all();
        if account.accepted != account.left + account.lost + waiting {
            let text = format!("{account:?}, and {waiting} packages wait in router {} of node {}", io.life, io.node);
            io.oracle.broken(io.now, Promise::Accounts, text);
        }
        let (out, inn) = (Sums::of(&self.stats.out), Sums::of(&self.stats.inn));
        if out != (Sums { packages: account.accepted, passed: account.left, lost: account.lost }) {
            io.oracle.broken(io.now, Promise::Accounts, format!("the router counts {out:?}, but did {account:?}"));
        }
        let partial = inn.packages.wrapping_sub(inn.passed + inn.lost);
        let most = (PARTIAL_MAX * (io.plan.nodes.len() - 1)) as u64;
        if partial > most {
            io.oracle.broken(io.now, Promise::Bounded, format!("{partial} packages are being put together: {inn:?}"));
        }
        let used = self.stats.waiting_bytes.get();
        if used > self.queue_bytes_max {
            let text = format!("the queue takes up {used} bytes, {} at most", self.queue_bytes_max);
            io.oracle.broken(io.now, Promise::Bounded, text);
        }
    }

    /// A datagram of a peer was taken.
    pub(super) fn hears(&mut self, io: &mut Io<'_>, source: Option<usize>) {
        let Some(peer) = source else { return };
        let before_ns = std::mem::replace(&mut self.heard_ns[peer], io.now.monotonic_ns);
        if io.now.monotonic_ns - before_ns >= SILENT_AFTER_NS {
            self.present_since_ns[peer] = io.now.monotonic_ns;
        }
        let heard = (io.now.true_ns, io.life, io.lives[peer]);
        io.oracle.heard.insert((io.node, peer), heard);
    }

    /// What this router says of its peers: a silent one is called so, and one that does not hear us.
    pub(super) fn check_links(&self, io: &mut Io<'_>) {
        let now_ns = io.now.monotonic_ns;
        if now_ns > self.polled_ns + STILL_NS {
            return;
        }
        for peer in (0..io.plan.nodes.len()).filter(|peer| *peer != io.node) {
            let state = self.stats.state(peer as NodeIndex, now_ns);
            let since_ns = |then_ns: u64| now_ns - then_ns.max(self.steady_since_ns);
            let is_there = matches!(state, PeerLinkState::Unknown | PeerLinkState::Alive);
            if is_there && since_ns(self.heard_ns[peer]) > SILENT_AFTER_NS + STILL_NS {
                let text = format!("node {peer} is {state:?} for node {}, which does not hear it", io.node);
                io.oracle.broken(io.now, Promise::Links, text);
            }
            let (heard_ns, life, own_incarnation) = io.oracle.heard.get(&(peer, io.node)).copied().unwrap_or_default();
            let goes_on = life == io.lives[peer] && own_incarnation == io.life;
            let doubt_ns = (io.now.true_ns - heard_ns.min(io.now.true_ns)).min(since_ns(self.present_since_ns[peer]));
            if is_there && goes_on && doubt_ns > UNHEARD_AFTER_NS + TELL_EVERY_NS + 2 * STILL_NS {
                let text = format!("node {peer} is {state:?} for node {}, which it does not hear", io.node);
                io.oracle.broken(io.now, Promise::Links, text);
            }
        }
    }

    /// At the end all losses on the wire are known, except those of a peer that was heard first so late that what is
    /// missing may still come.
    pub(super) fn check_losses(&self, io: &mut Io<'_>) {
        let is_settled = |peer: &usize| io.now.monotonic_ns - self.present_since_ns[*peer] > SETTLED_NS;
        for peer in (0..io.plan.nodes.len()).filter(|peer| *peer != io.node).filter(is_settled) {
            let missing = io.oracle.missing(io.life, peer as NodeIndex);
            let counted = self.stats.peer(peer as NodeIndex).received.missing();
            if missing.is_some_and(|missing| missing != counted) {
                let text =
                    format!("of node {peer} {missing:?} datagrams never came, node {} counts {counted}", io.node);
                io.oracle.broken(io.now, Promise::Links, text);
            }
        }
    }

    pub(super) fn check_well(&mut self, io: &mut Io<'_>) {
        for node in (0..io.plan.nodes.len()).filter(|node| *node != io.node) {
            let state = self.stats.state(node as NodeIndex, io.now.monotonic_ns);
            if state != PeerLinkState::Alive {
                io.oracle.broken(io.now, Promise::Recovery, format!("for node {}, node {node} is {state:?}", io.node));
            }
        }
        let lost = (Sums::of(&self.stats.out).lost, Sums::of(&self.stats.inn).lost);
        if *self.lost_before.get_or_insert(lost) != lost {
            let text = format!("node {} lost packages: {:?}, then {lost:?}", io.node, self.lost_before);
            io.oracle.broken(io.now, Promise::Recovery, text);
        }
    }
}
