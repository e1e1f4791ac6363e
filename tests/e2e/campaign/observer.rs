//! When the program had control, seen by a thread of its own before all load.

use super::stage::Stage;
use rohrpost::ToolLink;
use rohrpost::interfaces::{ControlMode, ControlState, SupervisorInterface};
use rohrpost::wire::from_bytes;
use rohrpost_config::Installation;
use rohrpost_mailbox::Node;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const LOOK: Duration = Duration::from_millis(5);
/// A wormhole that does not answer for so long gives nobody control.
const PATIENCE: Duration = Duration::from_millis(100);
/// A change is seen so much later than it was, at most.
pub(super) const SEEN_WITHIN: Duration = PATIENCE.saturating_add(LOOK.saturating_mul(3));

/// The thread, and what it saw.
pub(super) struct Observer {
    changes: Arc<Mutex<Vec<(Instant, bool)>>>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Observer {
    pub(super) fn begin(stage: &Stage) -> Self {
        let (changes, is_over) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let (node, node_name) = (stage.base().node.path().to_owned(), stage.base().node_name.clone());
        let thread = std::thread::spawn({
            let (changes, is_over, config) = (changes.clone(), is_over.clone(), stage.network.config.clone());
            move || {
                // Without the right to it, load makes it see later than it was.
                let _ = schedule(Scheduling::Fifo(90));
                observe(&config, (&node, &node_name), &changes, &is_over);
            }
        });
        Self { changes, is_over, thread: Some(thread) }
    }

    /// Since when the program has control, or has not.
    pub(super) fn now(&self) -> Option<(Instant, bool)> {
        self.changes.lock().unwrap().last().copied()
    }

    /// The first moment from then on at which the program has control, or has not.
    pub(super) fn first(&self, since: Instant, has_control: bool) -> Option<Instant> {
        let changes = self.changes.lock().unwrap();
        let before = changes.iter().rev().find(|(at, _)| *at <= since).filter(|(_, had)| *had == has_control);
        let after = changes.iter().find(|(at, has)| *at > since && *has == has_control);
        before.map(|_| since).or(after.map(|(at, _)| *at))
    }
}

impl Drop for Observer {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The number of `state` in the wormhole's interface.
const STATE: u16 = 23;

fn observe(
    config: &Path,
    (node, node_name): (&Path, &str),
    changes: &Mutex<Vec<(Instant, bool)>>,
    is_over: &AtomicBool,
) {
    let installation = Installation::load(config).unwrap();
    let wormhole = installation.classes.parse_module("wormhole.0").unwrap();
    let mut tool = None;
    while !is_over.load(Ordering::Relaxed) {
        if tool.is_none() {
            let node = Node::open(node).ok();
            tool = node.and_then(|node| ToolLink::join(&installation, &node, node_name, PATIENCE).ok());
        }
        let state = tool.as_mut().map(|tool| {
            let read = |bytes: &[u8]| from_bytes::<ControlState>(bytes);
            tool.call(wormhole, STATE, SupervisorInterface::hash(), |_| Ok(()), read)
        });
        let has_control = matches!(&state, Some(Ok(state)) if state.mode == ControlMode::Active);
        // What a launch that was killed leaves is another node.
        if !has_control && state.is_none_or(|state| state.is_err()) {
            tool = None;
        }
        let mut changes = changes.lock().unwrap();
        if changes.last().is_none_or(|(_, had)| *had != has_control) {
            changes.push((Instant::now(), has_control));
        }
        drop(changes);
        std::thread::sleep(LOOK);
    }
}
