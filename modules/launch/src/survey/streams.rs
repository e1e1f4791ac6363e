//! The streams of a node at one moment.

use rohrpost_mailbox::{Node, NodeError, StreamInfo};

/// A stream at one moment.
#[derive(Clone, Debug)]
pub struct StreamSurvey {
    /// The stream's node.
    pub node: String,
    /// When it was looked at, ns of that node's monotonic clock; so are the times of its records.
    pub at_ns: u64,
    /// What is known of it.
    pub info: StreamInfo,
}

/// All streams of a node, in order; without those that cannot be read.
pub(super) fn look(node: &Node, node_name: &str, at_ns: u64) -> Result<Vec<StreamSurvey>, NodeError> {
    let infos = node.streams()?.into_iter().filter_map(|id| node.inspect_stream(id).ok().flatten());
    Ok(infos.map(|info| StreamSurvey { node: node_name.into(), at_ns, info }).collect())
}
