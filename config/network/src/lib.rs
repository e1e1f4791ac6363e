//! What the network between nodes is, for those who plan it and for those who send: sizes of frames, the link, the table of time slots, what has
//! room in it, and how late a package can be.
//!
//! ```text
//!  sizes ◀── setup, table ◀── link, room ◀── plan ◀── bounds, remedy
//! ```
//!
//! `config` reads all of this from a file and says in words what does not fit; `routers` send by it. There is no file here, and no socket.
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
pub use plan::{Plan, PlannedFlow};
pub use remedy::Remedy;
pub use room::{ARRIVES_WITHIN, round_up};
pub use setup::{LEVEL_NOT_REAL_TIME, LEVELS, NODES_MAX, Network, Route, Security, TRANSIT_LOOK, level};
pub use sizes::{
    ALIVE_BYTES, BEND_MAX_PER, ETHERNET_BYTES, FRAGMENT_HEAD_BYTES, FRAME_HEAD_BYTES, HAND_OVER, HELLO_BYTES,
    KEPT_IN_BYTES, PAYLOAD_MAX, RATE_MAX_PER, REFUSAL_BYTES, TAG_BYTES, TIME_BYTES,
};
pub use table::{GATE, LATE, Tdma, TimeSlot, Tunnel};
