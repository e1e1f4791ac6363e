//! A POSIX queue, one way. Its sender sleeps in the kernel while it is full, the receiver while it is empty.

use super::{Sink, Source};
use crate::Failure;
use nix::mqueue::{MQ_OFlag, MqAttr, MqdT, mq_open, mq_receive, mq_send, mq_unlink};
use nix::sched::{CloneFlags, unshare};
use nix::sys::stat::Mode;
use std::sync::atomic::{AtomicU32, Ordering};

/// The kernel's limit for who may not exceed it.
const MSG_MAX: &str = "/proc/sys/fs/mqueue/msg_max";

/// Messages that a queue may hold, up to `wanted`: more than the system's limit only if this process may have a namespace of
/// its own, where it can raise it. So the calling process leaves the System V and POSIX queues of others; call it in a child.
pub fn deepest(wanted: usize) -> usize {
    let limit = || std::fs::read_to_string(MSG_MAX).ok()?.trim().parse::<usize>().ok();
    if limit().is_some_and(|limit| limit < wanted) && unshare(CloneFlags::CLONE_NEWIPC).is_ok() {
        // Refused, it stays as it is.
        let _ = std::fs::write(MSG_MAX, wanted.to_string());
    }
    limit().map_or(wanted, |limit| limit.min(wanted))
}

fn open(depth: usize, bytes: usize) -> Result<MqdT, Failure> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = format!("/rohrpost-bench-{}-{number}", std::process::id());
    let attributes = MqAttr::new(0, depth as _, bytes as _, 0);
    let flags = MQ_OFlag::O_RDWR | MQ_OFlag::O_CREAT | MQ_OFlag::O_EXCL;
    let queue = mq_open(name.as_str(), flags, Mode::S_IRUSR | Mode::S_IWUSR, Some(&attributes));
    // Whoever is forked later has the descriptor; nobody needs the name.
    let _ = mq_unlink(name.as_str());
    queue.map_err(|error| Failure::Skipped(format!("a POSIX queue of {depth} x {bytes} B: {error}")))
}

/// Either side of a queue; open it before forking.
pub struct Queue(MqdT);

impl Queue {
    /// A queue of its own.
    ///
    /// # Errors
    /// Skipped when the kernel has no room for it.
    pub fn new(depth: usize, bytes: usize) -> Result<Self, Failure> {
        Ok(Self(open(depth, bytes)?))
    }

    /// A sender of this priority.
    pub fn sink(&self, priority: u32) -> QueueSink<'_> {
        QueueSink { queue: &self.0, priority }
    }

    /// The receiver.
    pub fn source(&self) -> QueueSource<'_> {
        QueueSource { queue: &self.0 }
    }
}

/// Sends with one priority.
pub struct QueueSink<'a> {
    queue: &'a MqdT,
    priority: u32,
}

impl Sink for QueueSink<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        mq_send(self.queue, message, self.priority).map_err(|error| Failure::of("mq_send", error))
    }
}

/// Receives the most urgent.
pub struct QueueSource<'a> {
    queue: &'a MqdT,
}

impl Source for QueueSource<'_> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let mut priority = 0;
        match mq_receive(self.queue, message, &mut priority) {
            Ok(bytes) if bytes == message.len() => Ok(()),
            Ok(bytes) => Err(Failure::Failed(format!("a message of {bytes} bytes"))),
            Err(error) => Err(Failure::of("mq_receive", error)),
        }
    }
}
