//! The output of `rohrpost net` for people.

use super::node_report::NodeReport;
use super::{beyond, team};
use crate::look::target::Running;
use crate::nodes::quantities::counted;
use crate::nodes::tables::{self, by_class, kept};
use crate::nodes::vocabulary::Vocabulary;
use crate::terminal::table::{table, time};
use crate::terminal::units::{self, bytes, fine};
use rohrpost::interfaces::{ClockRole, ClockState, LinkState, Links, Rejected, ReplicaState};
use rohrpost::output::plain;
use std::time::Duration;

/// The whole report: a table of links, and tables of queues, losses and clocks, if there are any.
pub(super) fn text(running: &Running, all: &[NodeReport], vocabulary: &mut Vocabulary) -> String {
    let mut parts = vec![links(all)];
    let failed = all.iter().filter_map(|told| Some((&told.node, told.failure.as_ref()?)));
    parts.extend(failed.map(|(node, why)| format!("node {node}: {}\n", plain::line(why))));
    for (links, peer) in reports(all).flat_map(|links| links.peers.iter().map(move |peer| (links, peer))) {
        if !peer.why.is_empty() {
            let why = plain::line(&peer.why);
            parts.push(format!("node {} and node {} refuse each other: {why}\n", links.node, peer.node));
        }
    }
    parts.extend([strangers(all), rejections(all), failures(all), waiting(all), losses(running, all), clocks(all)]);
    parts.push(kept(all.iter().filter_map(|told| told.slots.as_ref())));
    parts.extend([measured(running, all, vocabulary), replicas(all)]);
    parts.extend(beyond::text(running, all));
    parts.extend(team::text(running, all));
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
}

/// What the routers that answer report of their links.
fn reports(all: &[NodeReport]) -> impl Iterator<Item = &Links> {
    all.iter().filter_map(|told| told.links.as_ref())
}

fn links(all: &[NodeReport]) -> String {
    let mut rows = Vec::new();
    for told in all {
        for peer in told.links.iter().flat_map(|links| &links.peers) {
            let rates = told.rates.iter().find(|rates| rates.node == peer.node);
            let rate = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.0}"));
            let bytes_s = |value: Option<f64>| value.map_or("-".into(), bytes);
            rows.push([
                told.node.clone(),
                peer.node.clone(),
                state(peer.state).into(),
                peer.heard_ms.map_or("never".into(), |ms| time(Duration::from_millis(ms))),
                rate(rates.map(|rates| rates.sent_packages_s)),
                bytes_s(rates.map(|rates| rates.sent_bytes_s)),
                rate(rates.map(|rates| rates.received_packages_s)),
                bytes_s(rates.map(|rates| rates.received_bytes_s)),
                counted(&peer.counters),
            ]);
        }
    }
    if rows.is_empty() {
        return String::new();
    }
    table(["node", "peer", "state", ">heard", ">out/s", ">B/s", ">in/s", ">B/s", "counted"], rows)
}

fn state(state: LinkState) -> &'static str {
    match state {
        LinkState::Unknown => "unknown",
        LinkState::Alive => "alive",
        LinkState::Silent => "silent",
        LinkState::Unheard => "unheard",
        LinkState::Refused => "refused",
    }
}

/// Rejected datagrams from unknown senders or from a peer with an unexpected identity, and what to do.
fn strangers(all: &[NodeReport]) -> String {
    let mut text = String::new();
    for links in reports(all) {
        for peer in links.peers.iter().filter(|peer| peer.counters.refused > 0) {
            text += &format!(
                "node {}: {} refused that came from {}, the address of node {}: they were of another configuration or \
                 version (launch all nodes from the same file; `rohrpost version`), or of a router of it that is \
                 over\n",
                links.node,
                units::counted(peer.counters.refused, "datagram"),
                peer.address,
                peer.node
            );
        }
        if links.foreign > 0 {
            text += &format!(
                "node {}: {} dropped that came from addresses of no node, or are nothing of Rohrpost's, or found the \
                 router's socket full: if another installation uses this network, give one of them another `port` in \
                 [network]\n",
                links.node,
                units::counted(links.foreign, "datagram")
            );
        }
    }
    text
}

/// Datagrams with a missing or wrong seal, by their apparent sender.
fn rejections(all: &[NodeReport]) -> String {
    let told = reports(all).flat_map(|links| links.rejections.iter().map(|rejected| (&links.node, rejected)));
    let rows: Vec<_> = told
        .map(|(node, Rejected { node: from, cause, datagrams })| {
            let from = if from.is_empty() { "no node" } else { from };
            [node.clone(), from.to_owned(), cause.clone(), datagrams.to_string()]
        })
        .collect();
    if rows.is_empty() { String::new() } else { table(["node", "not taken from", "cause", ">datagrams"], rows) }
}

/// Errors that computers returned. "Nobody listens" is not shown: that node is silent already.
fn failures(all: &[NodeReport]) -> String {
    let all = reports(all).flat_map(|links| links.failures.iter().map(|failure| (&links.node, failure)));
    let told = all.filter(|(_, failure)| failure.cause != "nobody-there");
    told.map(|(node, failure)| {
        format!("node {node}: {} not sent: {}\n", units::counted(failure.times, "datagram"), failure.cause)
    })
    .collect()
}

fn waiting(all: &[NodeReport]) -> String {
    let queues = reports(all).filter(|links| !links.waiting.is_empty()).map(|links| {
        let levels: Vec<String> =
            links.waiting.iter().map(|level| format!("{} on level {}", level.packages, level.level)).collect();
        let memory = bytes(links.waiting_bytes as f64);
        format!("node {}: packages that wait for the network: {} ({memory})\n", links.node, levels.join(", "))
    });
    queues.collect()
}

/// Classes with losses; the others are in the JSON.
fn losses(running: &Running, all: &[NodeReport]) -> String {
    by_class(&running.installation, reports(all), |class| !class.lost.is_empty())
}

/// Declared flows; empty if there is none.
fn measured(running: &Running, all: &[NodeReport], vocabulary: &mut Vocabulary) -> String {
    let links: Vec<&Links> = reports(all).collect();
    let states = all.iter().filter_map(|told| told.flows.as_ref());
    let table =
        tables::measured(&running.installation, states, &links, vocabulary, |module| running.describe(module).ok());
    if table.is_empty() { table } else { format!("{table}{}", tables::flows_legend()) }
}

/// Replicas, each on both of its ends; empty if there is none.
fn replicas(all: &[NodeReport]) -> String {
    let row = |node: &str, way: &str, state: &ReplicaState| {
        let lost: Vec<String> = state.lost.iter().map(|lost| format!("{} {}", lost.times, lost.cause)).collect();
        [
            node.to_owned(),
            state.stream.clone(),
            format!("{way} {}", state.node),
            state.records.to_string(),
            bytes(state.bytes as f64),
            state.gaps.map_or("-".into(), |gaps| gaps.to_string()),
            state.delay_p99_ns.map_or("-".into(), |ns| fine(ns as f64 * 1e-9)),
            again(state),
            if lost.is_empty() { "nothing".into() } else { lost.join(", ") },
        ]
    };
    let mut rows = Vec::new();
    for states in all.iter().filter_map(|told| told.replicas.as_ref()) {
        rows.extend(states.sent.iter().map(|state| row(&states.node, "to", state)));
        rows.extend(states.received.iter().map(|state| row(&states.node, "from", state)));
    }
    if rows.is_empty() {
        return String::new();
    }
    table(["node", "replica", "way", ">records", ">bytes", ">gaps", ">delay p99", "again", "not in it"], rows)
}

/// Parts that were lost on their way: how many were sent again, or asked for, and how many records came whole by that.
fn again(state: &ReplicaState) -> String {
    match (state.again, state.asked, state.completed) {
        (Some(again), _, _) => format!("{again} sent"),
        (None, Some(asked), Some(completed)) => format!("{asked} asked for, {completed} completed"),
        _ => "-".into(),
    }
}

fn clocks(all: &[NodeReport]) -> String {
    let clocks: Vec<&ClockState> = all.iter().filter_map(|told| told.clock.as_ref()).collect();
    if clocks.is_empty() {
        return String::new();
    }
    let ns = |ns: u64| fine(ns as f64 * 1e-9);
    let rows = clocks.into_iter().map(|clock| {
        [
            clock.node.clone(),
            match clock.role {
                ClockRole::Listening => "listening".into(),
                ClockRole::Slave => format!("slave of {}", clock.master),
                ClockRole::Master => "master".into(),
            },
            clock.error_ns.map_or("unknown".into(), |error_ns| format!("±{}", ns(error_ns))),
            format!("{} ns", clock.offset_ns),
            format!("{:.3} ppm", clock.rate_ppb as f64 / 1e3),
            clock.round_trip_ns.map_or("-".into(), ns),
        ]
    });
    table(["node", "time", ">error", ">offset", ">rate", ">there and back"], rows)
}
