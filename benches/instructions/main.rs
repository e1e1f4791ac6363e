//! Runs one hot path some thousand times, for `cargo xtask instructions`, which runs this under callgrind.
//!
//! `instructions` prints the names of the paths. `instructions PATH TIMES` runs one: callgrind counts what happens
//! inside [`counted`] and nothing else, so neither the preparation of an operation nor the first operations count.

#![allow(clippy::unwrap_used, reason = "a path that cannot be prepared cannot be counted")]

mod mailboxes;
mod routers;
mod seals;
mod streams;

use std::process::ExitCode;

/// Operations before those that count: rows are claimed, keys derived, lists filled by then.
const WARM_UP: usize = 200;

/// A hot path, ready to be run.
trait Path {
    /// Brings about what the next operation needs.
    fn prepare(&mut self) {}

    /// The operation.
    fn operate(&mut self);

    /// Clears away what the operation left.
    fn finish(&mut self) {}
}

/// A name, and how its path begins.
type Entry = (&'static str, fn() -> Box<dyn Path>);

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
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [asked, times] = arguments.as_slice() else {
        PATHS.iter().for_each(|(name, _)| println!("{name}"));
        return ExitCode::SUCCESS;
    };
    let Some((_, begin)) = PATHS.iter().find(|(name, _)| name == asked) else {
        eprintln!("no path {asked}");
        return ExitCode::FAILURE;
    };
    let (mut path, times) = (begin(), times.parse::<usize>().unwrap());
    for number in 0..WARM_UP + times {
        path.prepare();
        if number < WARM_UP {
            path.operate()
        } else {
            counted(path.as_mut())
        }
        path.finish();
    }
    ExitCode::SUCCESS
}

/// What callgrind counts, by this name.
#[inline(never)]
fn counted(path: &mut dyn Path) {
    path.operate();
}
