//! Log control: what the recorder is told by commands of its interface, and by TCP.

mod client;
mod orders;
mod server;

pub(super) use orders::{OpenOrder, Orders, Told};
pub(super) use server::ControlServer;
