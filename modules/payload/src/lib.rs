//! What a robot of a team does: it wanders, searches an intruder, and blocks it (seed 000, 4.3 to 4.5).
//!
//! ```text
//!  sense: pose, scan ──▶┌─ tree of events ─────────────────────────────────────────┐──▶ Promise ──▶ wormhole
//!  beat ───────────────▶│ communication: position, view, hello ──▶ Team            │──▶ messages ──▶ teammates
//!  hear: H, R, E ──────▶│ self-coordination: avoidance, move and pilot of the mode │──▶ News ──▶ people
//!                       │ multi-robot coordination: places, claims, plans          │
//!                       │ remote control: info, quit                               │
//!                       └──────────────────────────────────────────────────────────┘
//! ```
//!
//! [`Payload`] is one robot's program. The tree is that of the seed's figures 4.7 to 4.10, on
//! [`rohrpost_team::events`]. One of the branches wandering, searching and blocking is on. All driving is promises: a
//! wormhole ([`rohrpost_supervision`]) checks their time and their values.
//!
//! - A robot that does not know its cell is lost. It stands, says so, and goes on when it knows its cell again.
//! - With [`Settings::coordination`], robots share out entrances, plan together, and enter no cell without a claim
//!   ([`rohrpost_team::coordination`]). Without it each plans for itself, as in the seed.
//! - Cells are places on a continuous floor: the pilot steers along the line from middle to middle.
//!
//! [`Station`] is a person's place in the team: it has the same tree, so that robots know its events, and no body.
//!
//! Time is an argument, and chance comes from a seed. Nothing here reads a clock, sends, or waits.

#![forbid(unsafe_code)]

mod communication;
mod coordination;
mod event;
mod ground;
mod journey;
mod mode;
mod navigation;
mod payload;
mod remote;
mod request;
mod route;
mod sender;
mod settings;
mod state;
mod station;
mod steering;
mod tree;

pub use ground::{Ground, NoGround};
pub use mode::Mode;
pub use payload::{NotHeard, Payload, Sensed};
pub use request::{Answer, REPORT_CHARS_MAX, Report, Request, RequestId, RequestKind};
pub use sender::sender;
pub use settings::{RefusedSettings, Settings, Speeds};
pub use state::{LostCause, News};
pub use station::{Asked, Asking, FAKES_MAX, Said, Station, StationRefusal};
