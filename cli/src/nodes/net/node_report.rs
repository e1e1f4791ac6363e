//! The reports of a node's routers.

use rohrpost::interfaces::{
    BeyondClients, BeyondLink, BeyondState, ClockState, FlowStates, LinkState, Links, ReplicaStates, SlotState,
    TeamLinks,
};
use serde::Serialize;

#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct NodeReport {
    pub(super) node: String,
    /// The time of the report, system time.
    pub(super) time_ns: u64,
    pub(super) links: Option<Links>,
    pub(super) clock: Option<ClockState>,
    pub(super) slots: Option<SlotState>,
    pub(super) flows: Option<FlowStates>,
    /// Streams that it carries to or from other nodes, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) replicas: Option<ReplicaStates>,
    /// The state of its client of the TCP router.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) beyond: Option<BeyondLink>,
    /// The TCP router's report, if it runs there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) clients: Option<BeyondClients>,
    /// The state of its router of the team.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) team: Option<TeamLinks>,
    /// Bytes and packages a second, by peer; empty on the first poll.
    pub(super) rates: Vec<Rates>,
    /// Why there is no report.
    pub(super) failure: Option<String>,
}

/// Traffic to and from a peer, a second.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Rates {
    pub(super) node: String,
    pub(super) sent_packages_s: f64,
    pub(super) sent_bytes_s: f64,
    pub(super) received_packages_s: f64,
    pub(super) received_bytes_s: f64,
}

impl NodeReport {
    /// Replicas of one more end on this node.
    pub(super) fn add_replicas(&mut self, states: ReplicaStates) {
        match &mut self.replicas {
            Some(all) => {
                all.sent.extend(states.sent);
                all.received.extend(states.received);
            }
            None => self.replicas = Some(states),
        }
    }

    /// Whether its routers answer, all its peers are there, the TCP router is connected, and the network
    /// of the team is there. Other systems may come and go.
    pub(super) fn is_well(&self) -> bool {
        let all_alive = |links: &Links| links.peers.iter().all(|peer| peer.state == LinkState::Alive);
        self.failure.is_none()
            && self.links.as_ref().is_none_or(all_alive)
            && self.beyond.as_ref().is_none_or(|link| link.state == BeyondState::Up)
            && self.team.as_ref().is_none_or(|team| team.why.is_empty())
    }
}

/// Traffic between two reports; none if the router was restarted in between, or has not published a new report.
pub(super) fn rates(before: &NodeReport, now: &NodeReport) -> Vec<Rates> {
    let (Some(old), Some(new)) = (&before.links, &now.links) else { return Vec::new() };
    let elapsed_s = now.time_ns.saturating_sub(before.time_ns) as f64 * 1e-9;
    if elapsed_s <= 0.0 || new.uptime_ms < old.uptime_ms {
        return before.rates.clone();
    }
    let rate = |new: u64, old: u64| new.saturating_sub(old) as f64 / elapsed_s;
    let peers = new.peers.iter().zip(&old.peers).map(|(new, old)| Rates {
        node: new.node.clone(),
        sent_packages_s: rate(new.sent.packages, old.sent.packages),
        sent_bytes_s: rate(new.sent.bytes, old.sent.bytes),
        received_packages_s: rate(new.received.packages, old.received.packages),
        received_bytes_s: rate(new.received.bytes, old.received.bytes),
    });
    peers.collect()
}
