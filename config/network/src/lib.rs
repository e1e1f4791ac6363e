//! The network between nodes, for its planning and for the routers: sizes of frames, the link, the table of time slots,
//! the room in it, and bounds of delays.
//!
//! ```text
//!  sizes ◀── setup, table ◀── link, room ◀── plan ◀── bounds, remedy
//! ```
//!
//! `config` reads all of this from a file and reports mistakes; `routers` send by it. There is no file here, and no
//! socket.
#![forbid(unsafe_code)]

mod bounds;
mod link;
mod plan;
mod remedy;
mod room;
mod setup;
mod sizes;
mod table;

pub use bounds::{Bound, FlowBound, TAKEN_BEFORE, Unbounded};
pub use link::{Link, Parcel, TimeShare};
pub use plan::{Plan, PlannedFlow, PlannedReplica};
pub use remedy::Remedy;
pub use room::{ARRIVES_WITHIN, round_up};
pub use setup::{LEVEL_NOT_REAL_TIME, LEVELS, NODES_MAX, Network, Route, Security, TRANSIT_LOOK, level};
pub use sizes::{
    ALIVE_BYTES, BEND_MAX_PER, ETHERNET_BYTES, FRAGMENT_HEAD_BYTES, FRAME_HEAD_BYTES, HAND_OVER, HELLO_BYTES,
    KEPT_IN_BYTES, LINE_PART_BYTES, LINE_PART_HEADS_BYTES, PAYLOAD_MAX, RATE_MAX_PER, RECORD_PART_HEAD_BYTES,
    REFUSAL_BYTES, TAG_BYTES, TIME_BYTES,
};
pub use table::{GATE, LATE, Tdma, TimeSlot, Tunnel};
