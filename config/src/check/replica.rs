//! Rules across replicas and the modules that write their streams.

use crate::installation::Installation;
use crate::node::Reach;
use crate::reader::Reader;
use crate::replica::{REPLICAS_MAX, Replica};
use crate::stream::StreamSpec;
use crate::units::size_text;

/// With time slots records are compared in the slot of their node: a larger one would take a part of it.
const COMPARED_IN_SLOT_BYTES_MAX: u32 = 16 << 10;

/// Rules across replicas and modules.
pub(super) fn validate(installation: &Installation, reader: &Reader<'_>) {
    if let Some(first) = installation.replicas.get(REPLICAS_MAX) {
        reader.report(first.line, format!("[[replica]]: there are more than {REPLICAS_MAX}; drop some"));
    }
    for (at, replica) in installation.replicas.iter().enumerate() {
        let (text, report) = (replica.text(installation), |text: String| {
            reader.report(replica.line, format!("[[replica]] of `{}`: {text}", replica.text(installation)));
        });
        let Some(writer) = installation.module(replica.from) else { continue };
        if replica.to.contains(&writer.node) {
            report(format!("node {} writes this stream itself; drop the node from `to`", writer.node));
        }
        if let Some(missing) = missing_hop(installation, replica, &writer.node) {
            report(missing);
        }
        let StreamSpec { record_bytes, readers, .. } = replica.spec(installation);
        for (node, to) in installation.hops_by_tcp(replica) {
            let by_lan = installation.hop_by_lan(replica).is_some_and(|(source, _)| source == node);
            let routers = to.len() + usize::from(by_lan);
            if routers > usize::from(readers) {
                report(format!(
                    "on node {node} routers are {routers} of its readers, one for each node that has it by TCP, and it \
                     has {readers}; write `readers = {}` or more in [module.stream.{}]",
                    routers + 1,
                    replica.item
                ));
            }
        }
        if replica.changed && installation.tdma.is_some() && record_bytes > COMPARED_IN_SLOT_BYTES_MAX {
            report(format!(
                "with time slots records are compared in the slot of their node, and those of {} take too long; drop \
                 `changed`, or give the stream a `record` of at most {}",
                size_text(record_bytes.into()),
                size_text(COMPARED_IN_SLOT_BYTES_MAX.into())
            ));
        }
        let is_it = |other: &&Replica| (other.from, &other.item) == (replica.from, &replica.item);
        if let Some(first) = installation.replicas[..at].iter().find(is_it) {
            report(format!("`{text}` is in line {} already; name all its nodes there, and drop this one", first.line));
        }
    }
}

/// What is wrong with a replica that goes by the TCP router: that carries what its own node has.
fn missing_hop(installation: &Installation, replica: &Replica, writer: &str) -> Option<String> {
    let is_beyond = |name: &str| installation.node(name).is_some_and(|node| node.reach == Reach::Tcp);
    let mut others = std::iter::once(writer).chain(replica.to.iter().map(String::as_str));
    let beyond = others.find(|name| is_beyond(name))?;
    // That it runs on a node of the file is validated with the nodes.
    let server = installation.tcp.as_ref()?.server.as_deref()?;
    if writer == server || installation.tcp_server_with(replica).is_some() {
        return None;
    }
    Some(format!(
        "node {beyond} has `network = \"tcp\"`, and the TCP router carries the streams that its own node has; add \
         \"{server}\" to `to`"
    ))
}
