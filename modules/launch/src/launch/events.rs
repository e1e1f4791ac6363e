//! What wakes launch: signals, or its caller.

use super::LaunchError;
use rohrpost_mailbox::Participant;
use rohrpost_modules::launch_support::stop_signals;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Weak};

/// What wakes launch.
pub enum Event {
    /// End it all: a signal, or the program that runs launch. Said once more, moments later: at once.
    Stop,
    /// A child may have ended.
    Child,
}

/// A channel of events: SIGINT, SIGTERM and SIGHUP (a terminal was closed; not under `nohup`) say stop, SIGCHLD that a
/// child may have ended.
///
/// # Errors
/// [`LaunchError::Signals`].
pub fn events() -> Result<Receiver<Event>, LaunchError> {
    use signal_hook::consts::SIGCHLD;
    let heard = stop_signals().chain([SIGCHLD]);
    let mut signals = signal_hook::iterator::Signals::new(heard).map_err(LaunchError::Signals)?;
    let (sender, receiver) = std::sync::mpsc::channel();
    let forward = move || {
        for signal in signals.forever() {
            let event = if signal == SIGCHLD { Event::Child } else { Event::Stop };
            if sender.send(event).is_err() {
                break;
            }
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(forward).map_err(LaunchError::Signals)?;
    Ok(receiver)
}

/// A flag that is raised by each signal to stop from now on, also while nobody hears [`events`].
///
/// # Errors
/// [`LaunchError::Signals`].
pub fn stop_flag() -> Result<Arc<AtomicBool>, LaunchError> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in stop_signals() {
        signal_hook::flag::register(signal, flag.clone()).map_err(LaunchError::Signals)?;
    }
    Ok(flag)
}

/// Events, turned into rings of the bell that launch sleeps on.
pub(super) struct Bell {
    heard: Arc<Heard>,
}

#[derive(Default)]
struct Heard {
    /// Words to stop so far.
    words: AtomicU32,
    /// Something came since launch last looked.
    rung: AtomicBool,
}

impl Bell {
    /// Rings this participant's bell for each event. When nothing is left that could send one, that is a word to stop,
    /// too.
    pub(super) fn listen(events: Receiver<Event>, participant: &Arc<Participant>) -> Result<Self, LaunchError> {
        let heard = Arc::new(Heard::default());
        // Weak: when launch has left the node, this thread must not keep its place there.
        let (told, participant) = (heard.clone(), Arc::downgrade(participant));
        let listen = move || {
            for event in &events {
                told.note(matches!(event, Event::Stop), &participant);
            }
            told.note(true, &participant);
        };
        std::thread::Builder::new().name("events".into()).spawn(listen).map_err(LaunchError::Signals)?;
        Ok(Self { heard })
    }

    /// Words to stop so far.
    pub(super) fn words(&self) -> u32 {
        self.heard.words.load(Ordering::Acquire)
    }

    /// Whether something came since this was last asked.
    pub(super) fn was_rung(&self) -> bool {
        self.heard.rung.swap(false, Ordering::AcqRel)
    }
}

impl Heard {
    fn note(&self, stop: bool, participant: &Weak<Participant>) {
        self.words.fetch_add(u32::from(stop), Ordering::Release);
        self.rung.store(true, Ordering::Release);
        if let Some(participant) = participant.upgrade() {
            participant.ring();
        }
    }
}
