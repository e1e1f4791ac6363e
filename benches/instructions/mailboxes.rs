//! A package of 64 bytes through a mailbox, and the bytes of a typical message.

use super::Path;
use rohrpost_bench_local::harness::Scratch;
use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Receiver, Sender, Shape, Type};
use rohrpost_modules::types::{Odometry, Pose, Twist};
use rohrpost_modules::wire;
use std::hint::black_box;

const BYTES: usize = 64;
const MAILBOX: Name = Name::new(1, 200, 0, 0);
const LABEL: Label = Label {
    from: Name::new(1, 100, 0, 0),
    kind: Type::data(0),
    id: 0,
    priority: Priority(100),
    options: rohrpost_mailbox::Options(0),
};

/// A mailbox of this process, and a sender of another participant.
struct Mailbox {
    receiver: Receiver,
    sender: Sender,
    _scratch: Scratch,
}

impl Default for Mailbox {
    fn default() -> Self {
        let scratch = Scratch::new().unwrap();
        let node = Node::create(&scratch.directory().join("node"), 0o700).unwrap();
        let shape = Shape { body_bytes_max: BYTES as u16, ..Shape::default() };
        let receiver = Participant::join(&node, MAILBOX).unwrap().receiver(MAILBOX, shape).unwrap();
        let sender = Participant::join(&node, LABEL.from).unwrap().sender(MAILBOX).unwrap();
        Self { receiver, sender, _scratch: scratch }
    }
}

impl Mailbox {
    fn send(&mut self) {
        self.sender.send(&LABEL, &[black_box(&[7; BYTES])]).unwrap();
    }

    fn receive(&mut self) {
        let package = self.receiver.try_receive().expect("one was sent");
        assert_eq!(black_box(package.body()).len(), BYTES);
    }
}

/// Sends a package.
#[derive(Default)]
pub(super) struct Send {
    mailbox: Mailbox,
    /// One in so many is sent twice; 0: none.
    twice_every: usize,
    sent: usize,
}

impl Send {
    /// Must be reported: what tells a slower path from the recorded one is seen to do so.
    pub(super) fn slower_by_a_third() -> Self {
        Self { twice_every: 3, ..Self::default() }
    }
}

impl Path for Send {
    fn operate(&mut self) {
        self.sent += 1;
        self.mailbox.send();
        if self.twice_every > 0 && self.sent.is_multiple_of(self.twice_every) {
            self.mailbox.send();
        }
    }

    fn finish(&mut self) {
        self.mailbox.receive();
        while self.mailbox.receiver.try_receive().is_some() {}
    }
}

/// Sends a package that is written in its slot.
#[derive(Default)]
pub(super) struct SendInPlace(Mailbox);

impl Path for SendInPlace {
    fn operate(&mut self) {
        let mut loan = self.0.sender.loan(LABEL.priority).unwrap();
        loan.body()[..BYTES].copy_from_slice(black_box(&[7; BYTES]));
        loan.send(&LABEL, BYTES).unwrap();
    }

    fn finish(&mut self) {
        self.0.receive();
    }
}

/// Receives a package, read where it lies.
#[derive(Default)]
pub(super) struct Receive(Mailbox);

impl Path for Receive {
    fn prepare(&mut self) {
        self.0.send();
    }

    fn operate(&mut self) {
        self.0.receive();
    }
}

/// Looks for a package where none is.
#[derive(Default)]
pub(super) struct ReceiveNothing(Mailbox);

impl Path for ReceiveNothing {
    fn operate(&mut self) {
        assert!(self.0.receiver.try_receive().is_none());
    }
}

/// Where a robot is and how it moves: what most messages are like.
const ODOMETRY: Odometry = Odometry {
    pose: Pose { x_m: 1.25, y_m: -3.5, heading_rad: 0.7 },
    twist: Twist { speed_m_s: 0.3, turn_rate_rad_s: 0.1 },
};

/// Writes a message as bytes.
#[derive(Default)]
pub(super) struct Encode(Vec<u8>);

impl Path for Encode {
    fn operate(&mut self) {
        self.0.clear();
        wire::append(&mut self.0, black_box(&ODOMETRY)).unwrap();
    }
}

/// Reads a message from bytes.
pub(super) struct Decode(Vec<u8>);

impl Default for Decode {
    fn default() -> Self {
        let mut encode = Encode::default();
        encode.operate();
        Self(encode.0)
    }
}

impl Path for Decode {
    fn operate(&mut self) {
        assert_eq!(wire::from_bytes::<Odometry>(black_box(&self.0)).unwrap(), ODOMETRY);
    }
}
