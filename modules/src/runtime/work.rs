//! Which part of a module's own code runs, as tools see it and as people read it.

use crate::journal::JournalEvent;
use crate::output::plain;
use rohrpost_mailbox::Work;

/// What tools see of it.
pub(super) fn work_of(event: &JournalEvent<'_>) -> Work {
    match *event {
        JournalEvent::New => Work::New,
        JournalEvent::On => Work::On,
        JournalEvent::Off => Work::Off,
        JournalEvent::Tick => Work::Tick,
        JournalEvent::Received { number, .. } => Work::Received(number),
        JournalEvent::Function { number, .. } => Work::Function(number),
        JournalEvent::Parameters { .. } => Work::Parameters,
        JournalEvent::Ready { .. } => Work::Ready,
    }
}

/// A part of a module's own code, as its author calls it. `functions`: names by number, as the module tells them.
pub fn in_words(work: Work, functions: &[(u16, String)]) -> String {
    let part = match work {
        Work::New => "new",
        Work::On => "on",
        Work::Off => "off",
        Work::Tick => "tick",
        Work::Received(_) => "received",
        Work::Ready => "ready",
        Work::Parameters => "parameters_changed",
        Work::Function(number) => match functions.iter().find(|(known, _)| *known == number) {
            // What a module says of itself is a claim.
            Some((_, name)) => return format!("`{}`", plain::line(name)),
            None => return format!("function {number}"),
        },
    };
    format!("`{part}`")
}
