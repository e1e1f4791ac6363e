//! What an installation knows of its replicas.

use crate::installation::Installation;
use crate::replica::Replica;
use crate::stream::StreamSpec;
use rohrpost_mailbox::Name;

impl Replica {
    /// As the file names the stream.
    pub fn text(&self, installation: &Installation) -> String {
        format!("{}/{}", installation.classes.format(self.from), self.item)
    }

    /// The level on which it leaves: that of the class under which it is written. One process may write a pose and a
    /// picture, and has a name of a class for each: the pose does not wait for the picture.
    pub fn level(&self, installation: &Installation) -> u8 {
        installation.network.map_or(0, |network| network.level(self.from.class().priority()))
    }

    /// The shape that the stream has on each node.
    pub fn spec(&self, installation: &Installation) -> StreamSpec {
        let module = installation.module(self.from);
        module.and_then(|module| module.streams.get(&self.item)).copied().unwrap_or_default()
    }
}

impl Installation {
    /// The replica of a stream that a node has, if it has one.
    pub fn replica_on(&self, node: &str, from: Name, item: &str) -> Option<&Replica> {
        let is_it = |replica: &&Replica| {
            replica.from == from.module() && replica.item == item && replica.to.iter().any(|to| to == node)
        };
        self.replicas.iter().find(is_it)
    }

    /// What to write, so that a node has a replica of a stream that another one writes.
    pub fn replica_remedy(&self, node: &str, from: Name, item: &str) -> String {
        let known = self.replicas.iter().find(|replica| replica.from == from.module() && replica.item == item);
        match known {
            Some(replica) => format!("add \"{node}\" to `to` of the [[replica]] in line {}", replica.line),
            None => {
                let stream = format!("{}/{item}", self.classes.format(from.module()));
                format!("add a [[replica]] with `stream = \"{stream}\"` and `to = [\"{node}\"]`")
            }
        }
    }

    /// What must be equal on all nodes: the place of a replica is its number on the wire.
    pub(crate) fn replica_text(&self) -> impl Iterator<Item = String> {
        self.replicas.iter().enumerate().map(|(place, replica)| {
            let spec = replica.spec(self);
            let (StreamSpec { record_bytes, keep, readers, late }, to) = (spec, replica.to.join(" "));
            format!("replica {place} {} {record_bytes} {keep} {readers} {late:?} to {to}", replica.text(self))
        })
    }

    /// Bytes of shared memory that the replicas of a node take.
    pub(crate) fn replica_memory_on(&self, node: &str) -> impl Iterator<Item = u64> {
        let here = self.replicas.iter().filter(move |replica| replica.to.iter().any(|to| to == node));
        here.map(|replica| replica.spec(self).memory())
    }
}
