//! Rohrpost's own mailboxes, by nothing but their public interface.

use crate::harness::{End, Failure, Link, Meetings, OrFail, copy_whole};
use rohrpost_mailbox::{Label, Name, Node, Participant, Receiver, Sender, Shape, Type, Waiting};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// How long a spinning receiver looks before it sleeps: longer than any message takes, so that it never sleeps.
const SPIN: Duration = Duration::from_millis(100);

/// A participant on the node in this directory, which is made unless it is there.
///
/// # Errors
/// When it cannot be made or joined.
pub fn join(directory: &Path, own: Name) -> Result<Arc<Participant>, Failure> {
    let node = Node::create(directory, 0o700).or_fail("node")?;
    Participant::join(&node, own).or_fail("node")
}

/// A mailbox for bodies of this size.
///
/// # Errors
/// When no mailbox takes so much.
pub fn shape(bytes: usize) -> Result<Shape, Failure> {
    Ok(Shape { body_bytes_max: u16::try_from(bytes).or_fail("size of a body")?, ..Shape::default() })
}

/// The participant at an end of a ping-pong.
pub fn name(end: End) -> Name {
    Name::new(1, 1 + end.index() as u8, 0, 0)
}

/// How messages are sent and received.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum How {
    /// Copied in and out; the receiver sleeps.
    Blocking,
    /// Copied in and out; the receiver looks again and again before it would sleep.
    Spinning,
    /// The same, written and read in place.
    Loaned,
}

/// One end: a mailbox of its own, and the way into the other's.
pub struct Mailboxes {
    receiver: Receiver,
    sender: Sender,
    label: Label,
    how: How,
    waiting: Waiting,
    /// Bytes of each package, of which the link's user sees the head when they are loaned.
    bytes: usize,
}

impl Mailboxes {
    /// Opens an end on the node in this directory.
    ///
    /// # Errors
    /// When the mailboxes cannot be made.
    pub fn open(directory: &Path, end: End, bytes: usize, how: How, meetings: &mut Meetings) -> Result<Self, Failure> {
        let [mine, other] = [end, end.other()].map(name);
        let participant = join(directory, mine)?;
        let receiver = participant.receiver(mine, shape(bytes)?).or_fail("mailbox")?;
        meetings.meet()?;
        let sender = participant.sender(other).or_fail("mailbox")?;
        let spin = if how == How::Blocking { Duration::ZERO } else { SPIN };
        let label = Label { from: mine, kind: Type::command(16), ..Label::default() };
        Ok(Self { receiver, sender, label, how, waiting: Waiting { spin, deadline: None }, bytes })
    }
}

impl Link for Mailboxes {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let sent = match self.how {
            How::Blocking | How::Spinning => self.sender.send(&self.label, &[message]),
            How::Loaned => self.sender.loan(self.label.priority).and_then(|mut loan| {
                loan.body()[..message.len()].copy_from_slice(message);
                loan.send(&self.label, self.bytes)
            }),
        };
        sent.or_fail("send")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let package = self.receiver.receive_timeout(self.waiting);
        let package = package.ok_or_else(|| Failure::Failed("waited without a deadline, and got nothing".into()))?;
        let body = package.body();
        if body.len() != self.bytes || body.len() < message.len() {
            return Err(Failure::Failed(format!("{} bytes came, not {}", body.len(), self.bytes)));
        }
        message.copy_from_slice(&body[..message.len()]);
        Ok(())
    }
}

/// A process of a chain: its mailbox, if it receives, and the way into another's, opened when it is first used.
pub struct Station {
    participant: Arc<Participant>,
    receiver: Option<Receiver>,
    other: Name,
    sender: Option<Sender>,
}

impl Station {
    /// On the node in this directory.
    ///
    /// # Errors
    /// When the mailbox cannot be made.
    pub fn open(directory: &Path, own: Option<Name>, other: Name, bytes: usize) -> Result<Self, Failure> {
        let (participant, shape) = (join(directory, own.unwrap_or(Name::NONE))?, shape(bytes)?);
        let receiver = own.map(|own| participant.receiver(own, shape)).transpose().or_fail("mailbox")?;
        Ok(Self { participant, receiver, other, sender: None })
    }
}

impl Link for Station {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let sender = match &mut self.sender {
            Some(sender) => sender,
            none => none.insert(self.participant.sender(self.other).or_fail("sender")?),
        };
        let label = Label { kind: Type::data(0), ..Label::default() };
        sender.send(&label, &[message]).or_fail("send")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let receiver = self.receiver.as_mut().ok_or_else(|| Failure::Failed("it has no mailbox".into()))?;
        copy_whole(receiver.receive().body(), message)
    }
}
