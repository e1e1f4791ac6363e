//! Two modules on two nodes, by the public interface of mailboxes alone.

use super::flow::{LOOK, Outlet};
use crate::one_way::Sink;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Link, Meetings, OrFail, copy_whole};
use rohrpost_bench_local::ours::shape;
use rohrpost_mailbox::{
    Label, Name, Node, OverflowPolicy, Participant, Priority, Receiver, SendError, Sender, Shape, Type, Waiting,
};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Slots of a mailbox that must hold a whole window at once.
const SLOTS: u16 = 256;
/// Routers speak to each other five times a second.
const COMES_WITHIN: Duration = Duration::from_secs(60);
const SEND_EACH: Duration = Duration::from_millis(5);

/// One end of a ping-pong.
pub struct Module {
    receiver: Receiver,
    sender: Sender,
    label: Label,
    /// Longest wait for a package; none: for ever, which costs no timer.
    patience: Option<Duration>,
}

impl Module {
    /// Opens an end on the node with this directory, in the process that will use it; the names are its own and the
    /// other's.
    ///
    /// # Errors
    /// When the mailboxes cannot be made, or there is no route to the other node.
    pub fn between(
        directory: &Path,
        [own, other]: [Name; 2],
        bytes: usize,
        meetings: &mut Meetings,
    ) -> Result<Self, Failure> {
        let participant = join(directory, own)?;
        let receiver = participant.receiver(own, shape(bytes)?).or_fail("mailbox")?;
        meetings.meet()?;
        let sender = participant.sender(other).or_fail("way to the other node")?;
        let label = Label { from: own, kind: Type::data(0), priority: Priority(own.class().0), ..Label::default() };
        Ok(Self { receiver, sender, label, patience: None })
    }

    /// From now on a package that does not arrive in time counts as lost.
    #[must_use]
    pub fn with_patience(self, patience: Duration) -> Self {
        Self { patience: Some(patience), ..self }
    }
}

impl Link for Module {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.sender.send(&self.label, &[message]).or_fail("send")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let deadline = self.patience.map(|patience| Instant::now() + patience);
        let package = self.receiver.receive_timeout(Waiting { spin: Duration::ZERO, deadline });
        let package = package.ok_or_else(|| Failure::Failed("a package is lost".into()))?;
        copy_whole(package.body(), message)
    }
}

/// Sends packages from the node in the first directory to that in the second one until one has come. What comes to a
/// router before it knows the incarnation of the sending router is lost.
///
/// # Errors
/// When none comes.
pub fn await_way([from, to]: [&Path; 2], [own, other]: [Name; 2]) -> Result<(), Failure> {
    let sends = Child::start(|| {
        let message = [0; 16];
        let mut sink = LanSink::open(to, other, message.len())?;
        let mut source = LanSource::open(from, own, other)?;
        while sink.drain() == 0 {
            source.offer(&message)?;
            std::thread::sleep(SEND_EACH);
        }
        Ok(())
    })?;
    sends.finish(Instant::now() + COMES_WITHIN).or_fail("no package comes")
}

/// The sending side of a stream of packages.
pub struct LanSource {
    sender: Sender,
    label: Label,
}

impl LanSource {
    /// A sender on the node with this directory, of the priority of its class.
    ///
    /// # Errors
    /// When there is no route to the other node.
    pub fn open(directory: &Path, own: Name, to: Name) -> Result<Self, Failure> {
        let participant = join(directory, own)?;
        let sender = participant.sender(to).or_fail("way to the other node")?;
        let label = Label { from: own, kind: Type::data(0), priority: Priority(own.class().0), ..Label::default() };
        Ok(Self { sender, label })
    }

    /// From now on sends data of this type.
    #[must_use]
    pub fn of_type(self, kind: Type) -> Self {
        Self { label: Label { kind, ..self.label }, ..self }
    }

    /// Sends; false when the router's mailbox has no room.
    ///
    /// # Errors
    /// When it cannot be sent for another reason.
    pub fn offer(&mut self, message: &[u8]) -> Result<bool, Failure> {
        match self.sender.send(&self.label, &[message]) {
            Ok(()) => Ok(true),
            Err(SendError::Full(_)) => Ok(false),
            Err(error) => Err(Failure::of("send", error)),
        }
    }
}

impl Sink for LanSource {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        // The receiver counts what is missing.
        self.offer(message).map(drop)
    }
}

/// The receiving side.
pub struct LanSink {
    receiver: Receiver,
}

impl LanSink {
    /// A mailbox on the node with this directory.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(directory: &Path, own: Name, bytes: usize) -> Result<Self, Failure> {
        let participant = join(directory, own)?;
        let shape = Shape { slots: SLOTS, full: OverflowPolicy::Reject, ..shape(bytes)? };
        let receiver = participant.receiver(own, shape).or_fail("mailbox")?;
        Ok(Self { receiver })
    }

    /// Takes all packages that are there, and returns how many.
    pub fn drain(&mut self) -> u64 {
        let taken = std::iter::from_fn(|| self.receiver.try_receive().map(drop));
        taken.count() as u64
    }
}

impl Outlet for LanSink {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        // With a package there it reads no clock.
        let waiting = match self.receiver.try_receive() {
            Some(package) => return copy_whole(package.body(), message).map(|()| true),
            None => Waiting { spin: Duration::ZERO, deadline: Some(Instant::now() + LOOK) },
        };
        match self.receiver.receive_timeout(waiting) {
            Some(package) => copy_whole(package.body(), message).map(|()| true),
            None => Ok(false),
        }
    }
}

/// A participant on an existing node; without a name, or in the name of the module of this mailbox.
pub(super) fn join(directory: &Path, own: Name) -> Result<Arc<Participant>, Failure> {
    let node = Node::open(directory).or_fail("node")?;
    let module = Name::new(own.system(), own.class().0, own.instance(), 0);
    Participant::join(&node, module).or_fail("node")
}
