//! Sessions at work: the TCP router, and a node's client of it (seed 002, 3.2, third layer).
//!
//! ```text
//!  modules ─▶ tcp.I.3 ─▶ client ═ TCP ═▶ server ═ TCP ═▶ client ─▶ mailboxes
//!             a thread: mailbox and socket │ a thread: epoll over all sockets
//!                                          └ session::Server says what goes where
//! ```
//!
//! Both are processes of their own, and ordinary ones: nothing here shares a thread with the router of the LAN, or runs before a module.

mod client;
mod desk;
mod seal;
mod seen;
mod server;
mod stream;

pub use client::{ClientError, ClientParts, ClientShell};
pub use seal::{AUTHORITY, ClientSeal, Holder, SealError, ServerSeal};
pub use seen::{Class, Link, LinkState, Member, Members};
pub use server::{ServerError, ServerParts, ServerShell};
