//! Waiting for file descriptors and mailboxes at once, by one thread: for drivers of serial ports, sockets and the
//! like.

use crate::node::participant::Participant;
use crate::wake::bell::Bell;
use crate::wake::doorbell;
use std::io;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most descriptors that one participant watches.
pub const WATCHES_MAX: usize = 64;

/// How long a sleeper believes that its pipe would wake it. A ringer must open the pipe, and cannot when its process,
/// or the system, has no descriptor left; but it has changed the bell before, and that the sleeper sees after so long.
/// Costs ten looks at one word a second, and only participants that watch descriptors.
const PIPE_TRUSTED: Duration = Duration::from_millis(100);

/// One watched descriptor.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Watch(u32);

impl Watch {
    /// Its number: which of those that the participant has watched since it began.
    pub const fn number(self) -> u32 {
        self.0
    }

    /// The one of this number.
    ///
    /// ```
    /// # use rohrpost_mailbox::Watch;
    /// assert_eq!(Watch::from_number(7).number(), 7);
    /// ```
    pub const fn from_number(number: u32) -> Self {
        Self(number)
    }
}

/// What a descriptor is watched for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Interest {
    /// Something can be read, or will never be again.
    Read,
    /// There is room to write.
    Write,
    /// Either.
    Both,
}

impl Interest {
    fn events(self) -> libc::c_short {
        match self {
            Self::Read => libc::POLLIN,
            Self::Write => libc::POLLOUT,
            Self::Both => libc::POLLIN | libc::POLLOUT,
        }
    }
}

/// A watched descriptor for which there is something to do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ready {
    /// Which.
    pub watch: Watch,
    /// A read will not wait: it brings bytes, the end, or an error.
    pub readable: bool,
    /// A write will not wait: it takes bytes, or brings an error.
    pub writable: bool,
}

/// What `poll` brought.
#[derive(PartialEq, Eq)]
enum Polled {
    /// Its time has passed.
    Nothing,
    /// A descriptor is ready, the pipe among them, or a signal came.
    Something,
}

/// The descriptors that a participant waits for besides its mailboxes. It sleeps in `poll` then, and senders wake it
/// through a named pipe; they pay for that only while it does. Without a descriptor it sleeps as if this were not
/// there.
pub struct Watches {
    participant: Arc<Participant>,
    /// The pipe, then one for each of `polls` but the first.
    pipe: OwnedFd,
    watched: Vec<(Watch, OwnedFd)>,
    /// As the kernel wants them, one after the other; the first is the pipe's.
    polls: Vec<libc::pollfd>,
    next: u32,
}

impl Watches {
    /// Makes the participant's pipe.
    ///
    /// # Errors
    /// [`io::ErrorKind::AlreadyExists`] when the participant has some already: one thread sleeps for it. Otherwise what
    /// the system says of the pipe.
    pub fn new(participant: &Arc<Participant>) -> io::Result<Self> {
        let mut claim = participant.watching();
        if *claim {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "this participant watches descriptors already"));
        }
        let pipe = doorbell::make_pipe(participant.node(), participant.claimant().participant)?;
        *claim = true;
        drop(claim);
        // All the memory that it will ever need.
        let mut polls = Vec::with_capacity(1 + WATCHES_MAX);
        polls.push(libc::pollfd { fd: pipe.as_raw_fd(), events: libc::POLLIN, revents: 0 });
        Ok(Self { participant: participant.clone(), pipe, watched: Vec::with_capacity(WATCHES_MAX), polls, next: 0 })
    }

    /// Watches a descriptor, until [`Watches::remove`]. A duplicate is kept: the other end sees it closed only when it
    /// is removed here too.
    ///
    /// # Errors
    /// When there are [`WATCHES_MAX`], or the process has no descriptor left.
    pub fn add(&mut self, descriptor: &impl AsFd, interest: Interest) -> io::Result<Watch> {
        if self.watched.len() == WATCHES_MAX {
            let text = format!("{WATCHES_MAX} descriptors are watched already; remove one first");
            return Err(io::Error::new(io::ErrorKind::QuotaExceeded, text));
        }
        let own = descriptor.as_fd().try_clone_to_owned()?;
        let watch = Watch(self.next);
        self.next = self.next.wrapping_add(1);
        self.polls.push(libc::pollfd { fd: own.as_raw_fd(), events: interest.events(), revents: 0 });
        self.watched.push((watch, own));
        Ok(watch)
    }

    /// Watches it no longer; false when it was not watched.
    pub fn remove(&mut self, watch: Watch) -> bool {
        let at = self.watched.iter().position(|watched| watched.0 == watch);
        if let Some(at) = at {
            self.polls.swap_remove(1 + at);
            self.watched.swap_remove(at);
        }
        at.is_some()
    }

    /// Whether none is watched.
    pub fn is_empty(&self) -> bool {
        self.watched.is_empty()
    }

    pub(crate) fn participant(&self) -> &Arc<Participant> {
        &self.participant
    }

    /// Asks which are ready now, and returns at once. One system call, or none if nothing is watched.
    pub fn look(&mut self) {
        if !self.is_empty() {
            self.poll(Duration::ZERO);
        }
    }

    /// Whether one was ready at the last look and was not told yet.
    pub fn has_ready(&self) -> bool {
        self.polls.iter().skip(1).any(|poll| poll.revents != 0)
    }

    /// One that was ready at the last look; each is told once.
    pub fn next_ready(&mut self) -> Option<Ready> {
        let at = self.polls.iter().skip(1).position(|poll| poll.revents != 0)?;
        let happened = std::mem::take(&mut self.polls[1 + at].revents);
        let any = |events: libc::c_short| happened & (events | libc::POLLHUP | libc::POLLERR | libc::POLLNVAL) != 0;
        Some(Ready { watch: self.watched[at].0, readable: any(libc::POLLIN), writable: any(libc::POLLOUT) })
    }

    /// Sleeps until a descriptor is ready or the bell, which was `seen` before the last look, is rung.
    pub(crate) fn sleep(&mut self, bell: Bell<'_>, seen: u32, timeout: Option<Duration>) {
        let began = Instant::now();
        let left = || timeout.map_or(Duration::MAX, |timeout| timeout.saturating_sub(began.elapsed()));
        let quiet = bell.may_poll(seen);
        let mut nap = if quiet { left().min(PIPE_TRUSTED) } else { Duration::ZERO };
        while self.poll(nap) == Polled::Nothing && bell.seen() == seen {
            nap = left().min(PIPE_TRUSTED);
            if nap.is_zero() {
                break;
            }
        }
        bell.polled();
    }

    fn poll(&mut self, timeout: Duration) -> Polled {
        let timeout = doorbell::timespec(timeout);
        let count = self.polls.len() as libc::nfds_t;
        // SAFETY: so many entries are there, and ours alone; the timeout outlives the call, which only reads it; a null
        // mask leaves the signals as they are.
        let ready = unsafe { libc::ppoll(self.polls.as_mut_ptr(), count, &raw const timeout, std::ptr::null()) };
        if ready < 0 {
            // A signal, mostly. The kernel has written nothing, so what stands there is old.
            self.polls.iter_mut().for_each(|poll| poll.revents = 0);
        } else if self.polls[0].revents != 0 {
            doorbell::drain(&self.pipe);
        }
        if ready == 0 { Polled::Nothing } else { Polled::Something }
    }
}

impl Drop for Watches {
    fn drop(&mut self) {
        let mut claim = self.participant.watching();
        doorbell::remove_pipe(self.participant.node(), self.participant.claimant().participant);
        *claim = false;
    }
}
