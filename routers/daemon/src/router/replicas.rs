//! Replicas: how a router reads descriptions, and what it publishes of them.

use rohrpost_config::Installation;
use rohrpost_mailbox::Latency;
use rohrpost_modules::interfaces::{ReplicaCause, ReplicaState, ReplicaStates};
use rohrpost_modules::schema::Description;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::replication::{ReplicaCounts, ReplicaLoss, ReplicaLosses, ReplicaSettings};
use std::time::Duration;

/// Reads descriptions of modules.
pub(crate) fn stream_number(description: &[u8], item: &str) -> Option<u16> {
    let description = Description::from_bytes(description).ok()?;
    description.streams().find(|stream| stream.field.name == item).map(|stream| stream.number)
}

/// The present state on a node; none if it sends and has no replica. `all` is what `received` has the places of.
/// `delays`: those of the last report.
pub(crate) fn of(
    node: &str,
    counts: &ReplicaCounts,
    installation: &Installation,
    all: &[ReplicaSettings],
    delays: &mut Vec<Latency>,
) -> Option<ReplicaStates> {
    let name = |index: NodeIndex| installation.nodes.get(usize::from(index)).map(|node| node.name.clone());
    let stream = |place: u16| installation.replicas.get(usize::from(place)).map(|replica| replica.text(installation));
    let sent = counts.sent.iter().map(|sent| ReplicaState {
        stream: stream(sent.place).unwrap_or_default(),
        node: name(sent.to).unwrap_or_default(),
        records: sent.records.get(),
        bytes: sent.bytes.get(),
        gaps: None,
        asked: None,
        completed: None,
        again: Some(sent.again.get()),
        delay_recent_ns: None,
        delay_p99_ns: None,
        delay_worst_ns: None,
        delayed: None,
        lost: causes(&sent.lost),
    });
    let ns = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
    delays.resize_with(counts.received.len(), Latency::default);
    let received = counts.received.iter().zip(delays).map(|(received, earlier)| {
        let delay = received.delay.get();
        let (recent, p99) = (delay.since(earlier).mean(), delay.quantile(0.99));
        earlier.clone_from(&delay);
        ReplicaState {
            stream: stream(received.place).unwrap_or_default(),
            node: all.get(usize::from(received.place)).and_then(|replica| name(replica.node)).unwrap_or_default(),
            records: received.records.get(),
            bytes: received.bytes.get(),
            gaps: Some(received.gaps.get()),
            asked: Some(received.asked.get()),
            completed: Some(received.completed.get()),
            again: None,
            delay_recent_ns: recent.map(ns),
            delay_p99_ns: p99.map(ns),
            delay_worst_ns: p99.map(|_| ns(delay.max)),
            delayed: Some(received.delayed.get()),
            lost: causes(&received.lost),
        }
    });
    let is_any = !counts.sent.is_empty() || !counts.received.is_empty();
    is_any.then(|| ReplicaStates { node: node.into(), sent: sent.collect(), received: received.collect() })
}

fn causes(lost: &ReplicaLosses) -> Vec<ReplicaCause> {
    let all = ReplicaLoss::ALL.into_iter().map(|cause| (cause.word(), lost.of(cause)));
    all.filter(|(_, times)| *times > 0).map(|(cause, times)| ReplicaCause { cause: cause.into(), times }).collect()
}
