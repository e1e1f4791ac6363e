//! What an installation knows of its replicas.

use crate::installation::Installation;
use crate::node::Reach;
use crate::replica::Replica;
use crate::stream::StreamSpec;
use rohrpost_mailbox::{Name, Priority};

impl Replica {
    /// As the file names the stream.
    pub fn text(&self, installation: &Installation) -> String {
        format!("{}/{}", installation.classes.format(self.from), self.item)
    }

    /// The priority with which it leaves: that of the class under which it is written. One process may write a pose and
    /// a picture, and has a name of a class for each: the pose does not wait for the picture.
    pub fn priority(&self) -> Priority {
        self.from.class().priority()
    }

    /// The level of that on the LAN.
    pub fn level(&self, installation: &Installation) -> u8 {
        installation.network.map_or(0, |network| network.level(self.priority()))
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

    /// The node of the TCP router, if it has a replica by this entry: others may have the stream from there.
    pub fn tcp_server_with(&self, replica: &Replica) -> Option<&str> {
        let server = self.tcp.as_ref()?.server.as_deref()?;
        replica.to.iter().any(|to| to == server).then_some(server)
    }

    /// By the LAN: from which node to which ones; none if no node of the LAN has it from another one. What is written
    /// beyond the LAN comes from the TCP router's node.
    pub fn hop_by_lan<'a>(&'a self, replica: &'a Replica) -> Option<(&'a str, Vec<&'a str>)> {
        let is_there = |name: &&str| self.lan_index(name).is_some();
        let writer = self.node_of(replica.from).filter(is_there);
        let source = writer.or_else(|| self.tcp_server_with(replica).filter(is_there))?;
        let to = replica.to.iter().map(String::as_str).filter(|to| *to != source && is_there(to));
        Some((source, to.collect())).filter(|(_, to): &(_, Vec<&str>)| !to.is_empty())
    }

    /// By the TCP router: from which node to which ones, hop by hop.
    pub fn hops_by_tcp<'a>(&'a self, replica: &'a Replica) -> Vec<(&'a str, Vec<&'a str>)> {
        let is_beyond = |name: &&str| self.node(name).is_some_and(|node| node.reach == Reach::Tcp);
        let Some(server) = self.tcp.as_ref().and_then(|tcp| tcp.server.as_deref()) else { return Vec::new() };
        let writer = self.node_of(replica.from).unwrap_or_default();
        let others = replica.to.iter().map(String::as_str).filter(|to| *to != writer && is_beyond(to)).collect();
        let first = self.tcp_server_with(replica).filter(|_| is_beyond(&writer)).map(|server| (writer, vec![server]));
        let hops = first.into_iter().chain([(server, others)]);
        hops.filter(|(_, to): &(&str, Vec<&str>)| !to.is_empty()).collect()
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
