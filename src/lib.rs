//! Prioritised, real-time-style mailboxes for robots: what the author of a module needs.
//!
//! A module is a struct with an interface; the attribute makes a proxy for others from the interface's trait.
//!
//! ```
//! use rohrpost::{Context, Module, ModuleError};
//!
//! /// Tells where north is.
//! #[rohrpost::interface(class = "compass")]
//! pub trait Compass {
//!     /// Takes the present heading for this one (radians).
//!     #[command(16)]
//!     fn calibrate(&mut self, heading_rad: f64);
//!
//!     /// Heading, radians, counter-clockwise from east.
//!     #[data(1)]
//!     fn heading() -> f64;
//! }
//!
//! #[derive(rohrpost::serde::Deserialize)]
//! #[serde(crate = "rohrpost::serde", deny_unknown_fields)]
//! struct Settings {}
//!
//! struct Needle { offset_rad: f64 }
//!
//! impl Compass for Needle {
//!     fn calibrate(&mut self, heading_rad: f64) {
//!         self.offset_rad = heading_rad;
//!     }
//! }
//!
//! impl Module for Needle {
//!     type Settings = Settings;
//!     type Interfaces = CompassInterface;
//!
//!     fn new(_: Settings, context: &mut Context) -> Result<Self, ModuleError> {
//!         context.set_period(std::time::Duration::from_millis(100));
//!         Ok(Self { offset_rad: 0.0 })
//!     }
//!
//!     fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
//!         Ok(context.publish_now(CompassInterface::HEADING, &self.offset_rad)?)
//!     }
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     # if true { return std::process::ExitCode::SUCCESS }
//!     rohrpost::run::<Needle>()
//! }
//! ```

#![forbid(unsafe_code)]

pub use rohrpost_config::Installation;
pub use rohrpost_mailbox::{
    Class, CreateError, Interest, ModuleState, Name, Next, Node, OverflowPolicy, ParticipantInfo, Priority, Ready,
    RecordInfo, Shape, SystemTime, Watch,
};
pub use rohrpost_modules::call::{CallError, Fault, Pending};
#[doc(hidden)]
pub use rohrpost_modules::macro_support;
pub use rohrpost_modules::runtime::{
    BadRate, ClientError, Context, ContextError, ModuleClock, Moment, OpenValue, Rate, Received, Record, RecordError,
    Start, StartError, Stream, StreamReadError, StreamSubscription, Subscription, TimeTeller, ToolLink, Unreadable,
    describe, find_running, find_unusable,
};
pub use rohrpost_modules::serde;
pub use rohrpost_modules::{
    Module, ModuleError, choice, common, data, description, fusion, interface, interfaces, output, parameter,
    parameters, run, schema, types, wire,
};

/// What a module says: events become lines of output.
pub mod tracing {
    pub use ::tracing::{Level, debug, enabled, error, event, info, trace, warn};
}

// The book's code is compiled with the tests.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/guide.md")]
mod guide {}
#[cfg(doctest)]
#[doc = include_str!("../docs/src/exact.md")]
mod exact {}
