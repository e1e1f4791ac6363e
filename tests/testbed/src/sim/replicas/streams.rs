//! What the modules have that write streams and read replicas.

use super::rings::{Rings, words};
use crate::sim::plan::Plan;
use rohrpost_mailbox::{Name, StreamReader, StreamWriter};
use std::collections::BTreeMap;
use std::rc::Rc;

pub(in crate::sim) struct Streams {
    pub(super) rings: Rc<Rings>,
    pub(super) writers: Vec<Option<StreamWriter>>,
    pub(super) readers: Vec<ReplicaReader>,
    /// How often each module has described itself.
    pub(super) editions: BTreeMap<Name, u32>,
    pub(super) body: Vec<u8>,
}

pub(super) struct ReplicaReader {
    pub(super) stream: usize,
    pub(super) node: usize,
    pub(super) every_ns: u64,
    pub(super) seat: Option<StreamReader>,
    /// Generation and sequence of what it read last.
    pub(super) last: Option<(u32, u64)>,
    /// How often it was that once more.
    pub(super) again: u32,
    /// Records that it read, and those that it was told to have lost.
    pub(super) accounts: (u64, u64),
}

impl Streams {
    pub(in crate::sim) fn new(plan: &Plan, rings: &Rc<Rings>) -> Self {
        let reader = |stream: usize, &(node, every_ns): &(usize, u64)| ReplicaReader {
            stream,
            node,
            every_ns,
            seat: None,
            last: None,
            again: 0,
            accounts: (0, 0),
        };
        let all = plan.streams.iter().enumerate();
        let readers = all.flat_map(|(stream, its)| its.readers.iter().map(move |its| reader(stream, its))).collect();
        let writers = plan.streams.iter().map(|_| None).collect();
        Self { rings: rings.clone(), writers, readers, editions: BTreeMap::new(), body: Vec::new() }
    }

    pub(in crate::sim) fn readers(&self) -> usize {
        self.readers.len()
    }

    pub(super) fn describe(&mut self, node: usize, module: Name) {
        let edition = self.editions.entry(module).or_default();
        *edition += 1;
        let laid = self.rings.join(node).describe_replicas(module, &words(module, *edition));
        laid.expect("a node takes a description");
    }
}
