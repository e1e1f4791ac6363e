//! The hot paths of Rust, for `cargo xtask instructions`: see `run`. Those of the library for C are a program of their
//! own, `c`: in one program with these, what both call is no longer put into the one caller that it has elsewhere.

#![allow(clippy::unwrap_used, reason = "a path that cannot be prepared cannot be counted")]

mod mailboxes;
mod routers;
mod run;
mod seals;
mod streams;

use run::{Entry, Path};
use std::process::ExitCode;

const PATHS: [Entry; 15] = [
    ("send", || Box::new(mailboxes::Send::default())),
    ("send-slower-by-a-third", || Box::new(mailboxes::Send::slower_by_a_third())),
    ("send-in-place", || Box::new(mailboxes::SendInPlace::default())),
    ("receive", || Box::new(mailboxes::Receive::default())),
    ("receive-nothing", || Box::new(mailboxes::ReceiveNothing::default())),
    ("encode", || Box::new(mailboxes::Encode::default())),
    ("decode", || Box::new(mailboxes::Decode::default())),
    ("outbound-accept", || Box::new(routers::Accept::default())),
    ("inbound-handle", || Box::new(routers::Handle::default())),
    ("stream-write", || Box::new(streams::Write::default())),
    ("stream-copy", || Box::new(streams::Copy::default())),
    ("stream-hold", || Box::new(streams::Hold::default())),
    ("stream-around", || Box::new(streams::AroundTime::default())),
    ("seal", || Box::new(seals::Seal::default())),
    ("open", || Box::new(seals::Open::default())),
];

fn main() -> ExitCode {
    run::run(&PATHS)
}
