//! Requirements of an installation on its time slots, as input of the network's analysis.

use crate::flow::Flow;
use crate::installation::Installation;
use crate::record::Sampling;
use crate::replica::Replica;
use rohrpost_network::{FlowBound, Link, Plan, PlannedFlow, PlannedReplica, Tdma};
use std::time::Duration;

/// The bounds of all flows between different nodes of the LAN, by their places in [`Installation::flows`]; none if
/// nodes send as packages come.
pub fn bounds(installation: &Installation) -> Vec<FlowBound> {
    let tdma = installation.tdma.as_ref();
    tdma.and_then(|tdma| Some(plan(installation, tdma)?.bounds(tdma))).unwrap_or_default()
}

/// Records of full size that slots carry in a second for sure behind all flows, of each replica by its place in
/// [`Installation::replicas`] and as if it were alone; none if nodes send as packages come.
pub fn records_left(installation: &Installation) -> Vec<Option<f64>> {
    let of = |tdma| {
        let plan = plan(installation, tdma)?;
        let all = plan.replicas.iter().map(|planned| planned.map(|planned| plan.records_left(tdma, &planned)));
        Some(all.collect())
    };
    installation.tdma.as_ref().and_then(of).unwrap_or_default()
}

/// Requirements of its nodes and modules on a table.
pub(crate) fn plan(installation: &Installation, tdma: &Tdma) -> Option<Plan> {
    let (nodes, network) = (installation.lan_nodes(), installation.network?);
    let is_v6 = nodes.iter().filter_map(|node| node.address).any(|address| address.is_ipv6());
    let link = Link::new(tdma, &network, is_v6, nodes.len(), installation.time.masters().len());
    let flows = installation.flows.iter().map(|flow| planned(installation, flow)).collect();
    let replicas = installation.replicas.iter().map(|replica| replicated(installation, replica)).collect();
    Some(Plan { link, network, flows, replicas })
}

/// None if no node of the LAN has it from another one.
fn replicated(installation: &Installation, replica: &Replica) -> Option<PlannedReplica> {
    let (node, to) = installation.hop_by_lan(replica)?;
    let (node, receivers) = (installation.lan_index(node)?, to.len() as u32);
    let period = match replica.sampling {
        Sampling::Rate(rate_hz) => Duration::try_from_secs_f64(1.0 / rate_hz).ok(),
        Sampling::Each | Sampling::Every(_) => None,
    };
    let record_bytes = replica.spec(installation).record_bytes;
    Some(PlannedReplica { node, receivers, record_bytes, period })
}

/// None if both ends are on one node, or one is not on the LAN.
fn planned(installation: &Installation, flow: &Flow) -> Option<PlannedFlow> {
    let (from, to) = (installation.module(flow.from)?, installation.module(flow.to)?);
    let (node, peer) = (installation.lan_index(&from.node)?, installation.lan_index(&to.node)?);
    let commands = to.names().any(|name| from.calls.contains(&name)).then(|| from.name.class().priority());
    let data = from.names().any(|name| to.calls.contains(&name)).then(|| to.name.class().priority());
    let (commands, data) = (commands.or(data)?, data.or(commands)?);
    let (least, most) = if commands.outranks(data) { (data, commands) } else { (commands, data) };
    let Flow { size, period, deadline, .. } = *flow;
    (node != peer).then_some(PlannedFlow { node, peer, size, period, deadline, least, most })
}
