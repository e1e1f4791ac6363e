//! What crosses the bridge between the nodes.

use super::{NODES, address};
use rohrpost_mailbox::{HEAD_BYTES, Head};
use rohrpost_routers::frame::{FrameHead, FrameKind};
use rohrpost_routers::lab::{Crossing, Lab};
use rohrpost_routers::time::message::{Sync, TimeMessage};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// A frame of ours that crossed the bridge.
#[derive(Clone, Debug)]
pub(crate) struct Crossed {
    /// When it left its sender's device, monotonic ns.
    pub(crate) at_ns: u64,
    pub(crate) from: u8,
    pub(crate) kind: FrameKind,
    /// If it is a Sync of a master, not one in the place of another.
    pub(crate) sync: Option<Sync>,
    /// Of the whole packages in it.
    pub(crate) heads: Vec<Head>,
}

/// Heads of the packages that lie one behind the other.
fn heads(kind: FrameKind, mut packages: &[u8]) -> Vec<Head> {
    let next = || {
        let head = Head::from_bytes(packages).ok()?;
        packages = packages.get(HEAD_BYTES + usize::from(head.len)..)?;
        Some(head)
    };
    if kind == FrameKind::Packages { std::iter::from_fn(next).collect() } else { Vec::new() }
}

impl Crossed {
    fn of(crossing: &Crossing<'_>) -> Option<Self> {
        let (head, inside) = FrameHead::parse(crossing.datagram).ok()?;
        let from = (0..NODES).find(|node| address(*node) == crossing.source)?;
        let sync = match TimeMessage::parse(head.kind, inside) {
            Ok(TimeMessage::Sync(sync)) if !sync.replacement => Some(sync),
            _ => None,
        };
        Some(Self { at_ns: crossing.at_ns, from, kind: head.kind, sync, heads: heads(head.kind, inside) })
    }
}

/// Watches the bridge from a thread of its own.
pub(crate) struct Capture {
    ends: Arc<AtomicBool>,
    seen: Arc<Mutex<Vec<Crossed>>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Capture {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
    }
}

impl Capture {
    pub(crate) fn start(lab: &Lab) -> Self {
        let mut bridge = lab.capture().unwrap();
        let (ends, seen) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
        let thread = std::thread::spawn({
            let (ends, seen) = (ends.clone(), seen.clone());
            move || {
                while !ends.load(Ordering::Relaxed) {
                    std::thread::sleep(Duration::from_millis(20));
                    bridge.drain(|crossing| seen.lock().unwrap().extend(Crossed::of(&crossing)));
                }
            }
        });
        Self { ends, seen, thread: Some(thread) }
    }

    /// What was seen so far.
    pub(crate) fn so_far<R>(&self, look: impl FnOnce(&[Crossed]) -> R) -> R {
        look(&self.seen.lock().unwrap())
    }

    /// All that was seen.
    pub(crate) fn end(mut self) -> Vec<Crossed> {
        self.ends.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
        std::mem::take(&mut *self.seen.lock().unwrap())
    }
}
