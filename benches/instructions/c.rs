//! The hot paths of the library for C, for `cargo xtask instructions`: see `run`.

#![allow(clippy::unwrap_used, reason = "a path that cannot be prepared cannot be counted")]

mod run;

use rohrpost_bench_local::harness::Scratch;
use rohrpost_c::code::Code;
use rohrpost_c::mailbox::{
    MailboxShape, PackageInHand, PackageLabel, ReceiverHandle, SenderHandle, rohrpost_receive, rohrpost_receiver_open,
    rohrpost_receiver_release, rohrpost_send, rohrpost_sender_open,
};
use rohrpost_c::node::{NodeHandle, rohrpost_node_open_directory};
use rohrpost_mailbox::{Name, Shape, Type};
use run::{Entry, Path};
use std::ffi::CString;
use std::hint::black_box;
use std::mem::MaybeUninit;
use std::process::ExitCode;

const PATHS: [Entry; 2] = [("c-send", || Box::new(Send::default())), ("c-receive", || Box::new(Receive::default()))];

const BYTES: usize = 64;
const RECEIVER: Name = Name::new(1, 200, 0, 0);
const SENDER: Name = Name::new(1, 100, 0, 0);
const LABEL: PackageLabel =
    PackageLabel { from: SENDER.raw(), kind: Type::data(0).0, id: 0, priority: 100, options: 0 };

fn main() -> ExitCode {
    run::run(&PATHS)
}

/// A mailbox of this process, and a sender of another participant.
struct Mailbox {
    receiver: ReceiverHandle,
    sender: SenderHandle,
    _scratch: Scratch,
}

impl Default for Mailbox {
    fn default() -> Self {
        let scratch = Scratch::new().unwrap();
        let Shape { slots, claims, .. } = Shape::default();
        let shape = MailboxShape { slots, body_bytes_max: BYTES as u16, overflow: 0, claims, max_age_ns: 0 };
        let [theirs, own] = [RECEIVER, SENDER].map(|name| node(&scratch, name));
        let receiver = made(|out| rohrpost_receiver_open(theirs, RECEIVER.raw(), Some(&shape), Some(out)));
        let sender = made(|out| rohrpost_sender_open(own, RECEIVER.raw(), Some(out)));
        Self { receiver, sender, _scratch: scratch }
    }
}

fn node(scratch: &Scratch, own: Name) -> NodeHandle {
    let directory = CString::new(scratch.directory().join("node").into_os_string().into_encoded_bytes()).unwrap();
    // SAFETY: a zero ends the text.
    made(|out| unsafe { rohrpost_node_open_directory(directory.as_ptr(), true, own.raw(), Some(out)) })
}

/// What a call writes.
fn made<T>(call: impl FnOnce(&mut MaybeUninit<T>) -> Code) -> T {
    let mut out = MaybeUninit::uninit();
    done(call(&mut out));
    // SAFETY: a call that is done has written it.
    unsafe { out.assume_init() }
}

fn done(code: Code) {
    assert_eq!(code, Code::Ok);
}

impl Mailbox {
    fn send(&mut self) {
        let body = black_box(&[7_u8; BYTES]);
        // SAFETY: so many bytes are there.
        done(unsafe { rohrpost_send(self.sender, Some(&LABEL), body.as_ptr().cast(), BYTES) });
    }

    fn receive(&mut self) {
        let mut package = MaybeUninit::<PackageInHand>::uninit();
        done(rohrpost_receive(self.receiver, -1, Some(&mut package)));
        // SAFETY: the call is done, so it has written it.
        assert_eq!(usize::from(unsafe { black_box(&package).assume_init_ref() }.len), BYTES);
        done(rohrpost_receiver_release(self.receiver));
    }
}

/// Sends a package.
#[derive(Default)]
struct Send(Mailbox);

impl Path for Send {
    fn operate(&mut self) {
        self.0.send();
    }

    fn finish(&mut self) {
        self.0.receive();
    }
}

/// Receives a package, and gives it back.
#[derive(Default)]
struct Receive(Mailbox);

impl Path for Receive {
    fn prepare(&mut self) {
        self.0.send();
    }

    fn operate(&mut self) {
        self.0.receive();
    }
}
