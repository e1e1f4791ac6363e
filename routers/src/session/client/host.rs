//! What a client needs from the code that runs it, and tells it.

use crate::report::NotDelivered;
use crate::session::EndHost;
use crate::session::frame::{BadSessionFrame, Carried, RegistrationVerdict, SessionRefusal};

/// A change that people are told once.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ClientEvent<'a> {
    /// The server takes and brings packages.
    Up,
    /// It does not any more.
    Down,
    /// The server lets it not take part; it goes on trying.
    Refused(&'a SessionRefusal<'a>),
    /// It may not host what it says; it goes on trying.
    Objected(&'a RegistrationVerdict<'a>),
    /// What came is nothing of ours.
    Damaged(BadSessionFrame),
}

/// What a client needs from the code that runs it.
pub trait ClientHost: EndHost {
    /// Puts a package that came into its mailbox. Its `published_ns` is an estimate by the monotonic clock here.
    ///
    /// # Errors
    /// [`NotDelivered`]
    fn deliver(&mut self, carried: &Carried<'_>) -> Result<(), NotDelivered>;

    /// A command that came is not allowed, by the rule in this line of the configuration; its answer is asked for next.
    fn not_allowed(&mut self, _line: Option<usize>) {}

    /// Something happened.
    fn event(&mut self, event: ClientEvent<'_>);
}
