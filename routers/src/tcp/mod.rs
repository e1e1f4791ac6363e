//! Sessions at work: the TCP router, and a node's client of it (seed 002, 3.2, third layer).
//!
//! ```text
//!  modules ─▶ tcp.I.3 ─▶ client ═ TCP ═▶ server ═ TCP ═▶ client ─▶ mailboxes
//!             a thread: mailbox and socket │ a thread: epoll over all sockets
//!                                          └ session::Server says what goes where
//! ```
//!
//! Both are processes of their own, and ordinary ones: nothing here shares a thread with the router of the LAN, or runs
//! before a module.

mod bad_line;
mod client;
pub(crate) mod fault_writer;
mod line_throttle;
mod pace;
mod replicas;
mod seal;
mod server;
pub(crate) mod snapshots;
mod stream;
mod validity;

pub use client::{ClientError, ClientParts, ClientShell};
pub use replicas::{LineCounts, LineParts};
pub use seal::{AUTHORITY, Authority, ClientSeal, Holder, PREFIX, SealError, Sealed, ServerSeal, is_about};
pub use server::{ServerError, ServerParts, ServerShell};
pub use snapshots::{Class, ClientLink, LinkState, MEMBERS_MAX, Members, Outage};
pub use stream::{Moved, Stream};
pub use validity::holds_until_s;
