//! The kernel's own priority queue, POSIX `mq`: one in each direction.

use nix::mqueue::{MQ_OFlag, MqAttr, MqdT, mq_attr_member_t, mq_close, mq_open, mq_receive, mq_send, mq_unlink};
use nix::sched::{CloneFlags, unshare};
use nix::sys::resource::{RLIM_INFINITY, Resource, setrlimit};
use nix::sys::stat::Mode;
use rohrpost_bench_local::harness::{End, Failure, Link, OrFail};
use std::fs;
use std::sync::Once;

/// Messages in a queue of the latency cases, where at most one waits. Few, since large messages reach
/// RLIMIT_MSGQUEUE, 800 KiB for all queues of a user.
const DEPTH: usize = 4;

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

    /// Sends with this priority; waits while it is full.
    ///
    /// # Errors
    /// What the kernel says.
    pub fn send(&self, message: &[u8], priority: u32) -> Result<(), Failure> {
        mq_send(self.open()?, message, priority).or_fail("mq_send")
    }

    /// Receives the most important message, of exactly this length; sleeps until there is one. Gives its priority.
    ///
    /// # Errors
    /// What the kernel says, or when the message has another length.
    pub fn receive(&self, message: &mut [u8]) -> Result<u32, Failure> {
        let mut priority = 0;
        match mq_receive(self.open()?, message, &mut priority) {
            Ok(bytes) if bytes == message.len() => Ok(priority),
            Ok(bytes) => Err(Failure::Failed(format!("{bytes} bytes came, not {}", message.len()))),
            Err(error) => Err(Failure::of("mq_receive", error)),
        }
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

/// Both directions.
pub struct Queues([Queue; 2]);

impl Queues {
    /// Makes them, before the ends are forked.
    ///
    /// # Errors
    /// As [`Queue::new`].
    pub fn new(bytes: usize) -> Result<Self, Failure> {
        Ok(Self([Queue::new(DEPTH, bytes)?, Queue::new(DEPTH, bytes)?]))
    }

    /// An end of them.
    pub fn end(&self, end: End) -> QueueEnd<'_> {
        let [there, back] = &self.0;
        let (out, back) = if end == End::Ping { (there, back) } else { (back, there) };
        QueueEnd { out, back }
    }
}

/// One end.
pub struct QueueEnd<'a> {
    out: &'a Queue,
    back: &'a Queue,
}

impl Link for QueueEnd<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.out.send(message, 0)
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        self.back.receive(message).map(drop)
    }
}
