//! Refusals and hellos between the thread that receives and the one that sends in time slots.

use crate::security::{HELLO_DATAGRAM_BYTES, OutgoingHello};
use crate::settings::Settings;
use std::net::IpAddr;

/// Room for the longest refusal, and for a hello.
pub const ANSWER_BYTES: usize = 128;
/// Refusals that wait for a slot, and hellos that the thread has not looked at yet; more are lost, and said again a
/// second later.
pub const ANSWERS: usize = 32;

const _: () = assert!(HELLO_DATAGRAM_BYTES <= ANSWER_BYTES, "a hello leaves as a refusal does");

/// What the thread that receives wants to have sent.
pub enum Answer {
    /// Where nothing is sealed: another configuration or version is refused.
    Refusal {
        /// Its receiver.
        to: IpAddr,
        /// Length.
        bytes: usize,
        /// Begins with the refusal.
        datagram: [u8; ANSWER_BYTES],
    },
    /// Where all is sealed.
    Hello {
        /// Its receiver, and what it says.
        said: OutgoingHello,
        /// Begins with the hello.
        datagram: [u8; ANSWER_BYTES],
    },
}

impl Answer {
    /// The address of its receiver.
    pub fn to(&self, settings: &Settings) -> IpAddr {
        match self {
            Self::Refusal { to, .. } => *to,
            Self::Hello { said, .. } => settings.nodes[usize::from(said.to)].address,
        }
    }

    /// What is to be sent.
    pub fn datagram(&self) -> &[u8] {
        match self {
            Self::Refusal { bytes, datagram, .. } => &datagram[..*bytes],
            Self::Hello { said, datagram } => &datagram[..said.bytes],
        }
    }
}
