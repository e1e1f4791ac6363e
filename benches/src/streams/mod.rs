//! Streams, by nothing but their public interface.

mod link;
mod node;
mod one_way;

pub use link::StreamLink;
pub use node::{StreamNode, came, stamp, stream_failure};
pub use one_way::{Progress, RecordSink, RecordSource};
