//! Rohrpost's own mailboxes, by nothing but their public interface.

use crate::harness::{End, Failure, Link, Meetings};
use rohrpost_mailbox::{Label, Name, Node, Participant, Receiver, Sender, Shape, Type, Waiting};
use std::path::Path;
use std::time::Duration;

/// How long a spinning receiver looks before it sleeps: longer than any message takes, so that it never sleeps.
const SPIN: Duration = Duration::from_millis(100);

/// How messages are sent and received.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum How {
    /// Copied in and out; the receiver sleeps.
    Blocking,
    /// Copied in and out; the receiver looks again and again before it would sleep.
    Spinning,
}

/// One end: a mailbox of its own, and the way into the other's.
pub struct Mailboxes {
    receiver: Receiver,
    sender: Sender,
    label: Label,
    waiting: Waiting,
}

impl Mailboxes {
    /// Opens an end on the node in this directory.
    ///
    /// # Errors
    /// When the mailboxes cannot be made.
    pub fn open(directory: &Path, end: End, bytes: usize, how: How, meetings: &mut Meetings) -> Result<Self, Failure> {
        let failed = |error: &dyn std::fmt::Display| Failure::of("mailbox", error);
        let body_bytes_max = u16::try_from(bytes).map_err(|error| failed(&error))?;
        let (mine, other) = match end {
            End::Ping => (Name::new(1, 1, 0, 0), Name::new(1, 2, 0, 0)),
            End::Pong => (Name::new(1, 2, 0, 0), Name::new(1, 1, 0, 0)),
        };
        let node = Node::create(directory, 0o700).map_err(|error| failed(&error))?;
        let participant = Participant::join(&node, mine).map_err(|error| failed(&error))?;
        let shape = Shape { body_bytes_max, ..Shape::default() };
        let receiver = participant.receiver(mine, shape).map_err(|error| failed(&error))?;
        meetings.meet()?;
        let sender = participant.sender(other).map_err(|error| failed(&error))?;
        let spin = if how == How::Spinning { SPIN } else { Duration::ZERO };
        let label = Label { from: mine, kind: Type::command(16), ..Label::default() };
        Ok(Self { receiver, sender, label, waiting: Waiting { spin, deadline: None } })
    }
}

impl Link for Mailboxes {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.sender.send(&self.label, &[message]).map_err(|error| Failure::of("send", error))
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let package = self.receiver.receive_timeout(self.waiting);
        let package = package.ok_or_else(|| Failure::Failed("waited without a deadline, and got nothing".into()))?;
        if package.body().len() != message.len() {
            return Err(Failure::Failed(format!("{} bytes came, not {}", package.body().len(), message.len())));
        }
        message.copy_from_slice(package.body());
        Ok(())
    }
}
