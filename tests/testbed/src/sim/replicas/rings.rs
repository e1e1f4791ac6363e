//! Rings of the simulated computers: nodes as the mailboxes have them, in shared memory.

use super::stream::StreamPlan;
use crate::sim::plan::Plan;
use rohrpost_mailbox::{Name, Node, Participant, StreamId};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::replication::ReplicaSettings;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Where memory is; a node's own directories are there as well.
const MEMORY: &str = "/dev/shm";
/// A record that arrives so much later is told, ns.
const ALARM_NS: u64 = 5_000_000;

pub(crate) struct Rings {
    _folder: tempfile::TempDir,
    nodes: Vec<Arc<Node>>,
    replicas: Vec<ReplicaSettings>,
    /// Records say when they were written by the clock of the computer that simulates: what that was on the clock of
    /// the simulated one, ns.
    moments: RefCell<HashMap<u64, u64>>,
}

impl Rings {
    /// Of the computers of a plan, which are empty.
    ///
    /// # Panics
    /// If this computer has no room for them.
    pub(crate) fn new(plan: &Plan) -> Self {
        let folder = tempfile::tempdir_in(Path::new(MEMORY)).expect("there is room for rings");
        let node = |node: usize| Node::create(&folder.path().join(node.to_string()), 0o700).expect("and for a node");
        // Without streams nobody opens a node.
        let count = if plan.streams.is_empty() { 0 } else { plan.nodes.len() };
        let nodes = (0..count).map(node).collect();
        let replicas = plan.streams.iter().map(|stream| settings(plan, stream)).collect();
        Self { _folder: folder, nodes, replicas, moments: RefCell::default() }
    }

    /// What routers are configured with.
    pub(crate) fn replicas(&self) -> &[ReplicaSettings] {
        &self.replicas
    }

    pub(crate) fn node(&self, node: usize) -> &Arc<Node> {
        &self.nodes[node]
    }

    /// A program begins there.
    ///
    /// # Panics
    /// If too many did.
    pub(crate) fn join(&self, node: usize) -> Arc<Participant> {
        Participant::join(self.node(node), Name::NONE).expect("a node has room for programs")
    }

    /// A record was written then.
    pub(super) fn note_moment(&self, real_ns: u64, simulated_ns: u64) {
        self.moments.borrow_mut().insert(real_ns, simulated_ns);
    }

    /// When a record was written, on its node's monotonic clock.
    pub(super) fn simulated_ns(&self, real_ns: u64) -> u64 {
        self.moments.borrow().get(&real_ns).copied().unwrap_or_default()
    }
}

fn settings(plan: &Plan, stream: &StreamPlan) -> ReplicaSettings {
    ReplicaSettings {
        from: stream.id.name,
        item: item(stream.id),
        stream: format!("{}/{}", stream.id.name, item(stream.id)),
        shape: stream.shape,
        node: stream.node as NodeIndex,
        to: stream.to,
        sampling: stream.sampling,
        changed: stream.changed,
        delay_alarm_ns: ALARM_NS,
        deadline_ns: stream.deadline_ns,
        level: stream.level(plan.shape.bulk_below),
    }
}

fn item(id: StreamId) -> String {
    format!("s{}", id.number)
}

/// What a module says of itself, in an edition of its interface: all bytes say which, so that one of two is none.
pub(super) fn words(module: Name, edition: u32) -> Vec<u8> {
    let mix = (u64::from(module.raw()) << 32 | u64::from(edition)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut words: Vec<u8> = (0..8 + (mix >> 48) % 5000).map(|at| (mix >> (at % 8 * 8)) as u8 ^ at as u8).collect();
    words[..4].copy_from_slice(&module.raw().to_le_bytes());
    words[4..8].copy_from_slice(&edition.to_le_bytes());
    words
}

/// Reads such words.
pub(super) fn stream_number(description: &[u8], name: &str) -> Option<u16> {
    let number = |at: usize| Some(u32::from_le_bytes(*description.get(at..)?.first_chunk()?));
    let expected = words(Name::from_raw(number(0)?), number(4)?);
    (description == expected).then(|| name.strip_prefix('s')?.parse().ok()).flatten()
}
