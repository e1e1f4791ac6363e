//! Rules across replicas and the modules that write their streams.

use crate::installation::Installation;
use crate::node::Reach;
use crate::reader::Reader;
use crate::replica::{REPLICAS_MAX, Replica};
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
        if installation.node(&writer.node).is_some_and(|node| node.reach == Reach::Tcp) {
            report(format!(
                "node {}, which writes it, has `network = \"tcp\"`, and replicas are not carried by TCP yet; drop the \
                 replica",
                writer.node
            ));
        }
        let record_bytes = replica.spec(installation).record_bytes;
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
