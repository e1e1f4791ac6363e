//! The kernel's own priority queue, POSIX `mq`.

use crate::one_way::{Sink, Source};
use nix::mqueue::{MQ_OFlag, MqAttr, MqdT, mq_attr_member_t, mq_close, mq_open, mq_receive, mq_send, mq_unlink};
use nix::sched::{CloneFlags, unshare};
use nix::sys::resource::{RLIM_INFINITY, Resource, setrlimit};
use nix::sys::stat::Mode;
use rohrpost_bench_local::{Failure, OrFail};
use std::fs;
use std::sync::Once;

/// A queue without a name: processes forked from now on share it, and it ends with the last of them.
pub struct Queue {
    /// None while it is dropped.
    open: Option<MqdT>,
}

impl Queue {
    /// Makes one.
    ///
    /// # Errors
    /// [`Failure::Skipped`] when the kernel's limits are too small and cannot be raised.
    pub fn new(depth: usize, bytes: usize) -> Result<Self, Failure> {
        static RAISE: Once = Once::new();
        RAISE.call_once(raise_limits);
        let name = format!("/rohrpost-bench-{}", std::process::id());
        let attributes = MqAttr::new(0, depth as mq_attr_member_t, bytes as mq_attr_member_t, 0);
        let flags = MQ_OFlag::O_RDWR | MQ_OFlag::O_CREAT | MQ_OFlag::O_EXCL;
        let refused = |error| {
            Failure::Skipped(format!("a POSIX queue of {depth} × {bytes} B is refused, which root may have: {error}"))
        };
        let queue = mq_open(name.as_str(), flags, Mode::S_IRUSR | Mode::S_IWUSR, Some(&attributes)).map_err(refused)?;
        mq_unlink(name.as_str()).or_fail("mq_unlink")?;
        Ok(Self { open: Some(queue) })
    }

    fn open(&self) -> Result<&MqdT, Failure> {
        self.open.as_ref().ok_or_else(|| Failure::Failed("the queue is closed".into()))
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        // All queues of a user have a common limit, so they must be removed.
        let _ = self.open.take().map(mq_close);
    }
}

/// Enters a namespace of its own and raises the limits there, if that is allowed; else the usual limits apply.
fn raise_limits() {
    let _ = setrlimit(Resource::RLIMIT_MSGQUEUE, RLIM_INFINITY, RLIM_INFINITY);
    if unshare(CloneFlags::CLONE_NEWIPC).is_ok() {
        for (limit, value) in [("msg_max", "1024"), ("msgsize_max", "65536")] {
            let _ = fs::write(format!("/proc/sys/fs/mqueue/{limit}"), value);
        }
    }
}

/// Sends into a queue with one priority; waits while it is full.
pub struct QueueSink<'a> {
    queue: &'a Queue,
    priority: u32,
}

impl<'a> QueueSink<'a> {
    /// A sender of this priority.
    pub fn new(queue: &'a Queue, priority: u32) -> Self {
        Self { queue, priority }
    }
}

impl Sink for QueueSink<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        mq_send(self.queue.open()?, message, self.priority).or_fail("mq_send")
    }
}

/// Receives the most important message; sleeps until there is one.
impl Source for &Queue {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        match mq_receive(self.open()?, message, &mut 0).or_fail("mq_receive")? {
            bytes if bytes == message.len() => Ok(()),
            bytes => Err(Failure::Failed(format!("{bytes} bytes came, not {}", message.len()))),
        }
    }
}
