//! Counts, packages by class, losses by cause, and datagrams: the parts of what a router counts
//! ([`stats`](crate::stats)).
//!
//! One thread writes each counter (`out`: the one that sends; `inn`: the one that receives), any thread reads: so a
//! count is a load and a store, no locked instruction. Accounts balance, by class:
//!
//! ```text
//! out.packages  =  out.passed + out.lost, all causes  + those that wait
//! inn.packages  =  inn.passed + inn.lost, all causes  + those of which only fragments have come
//! ```

use rohrpost_mailbox::Priority;
use std::sync::atomic::{AtomicU64, Ordering};

rohrpost_mailbox::causes! {
    /// Why a package was lost in a router.
    pub enum Cause {
        /// Outgoing: no node has its mailbox.
        NoRoute = "no-route",
        /// Outgoing: its sender had more waiting than its quota, and this was the least important and newest.
        Quota = "quota",
        /// It was under way for too long.
        Stale = "stale",
        /// Outgoing: nothing is heard of the node.
        Silent = "silent",
        /// Outgoing: the node is heard, but does not hear us.
        Unheard = "unheard",
        /// Outgoing: the node and we refuse each other.
        Refused = "refused",
        /// Outgoing: the socket did not take it.
        Socket = "socket",
        /// Incoming: a newer one of the same sender, receiver and priority had been delivered.
        Late = "late",
        /// Incoming: fragments of it never came.
        Incomplete = "incomplete",
        /// Incoming: nobody has its mailbox open.
        NoMailbox = "no-mailbox",
        /// Incoming: its mailbox was full.
        MailboxFull = "mailbox-full",
        /// Incoming: its mailbox has smaller slots.
        TooLarge = "too-large",
        /// Incoming: the node that sent it does not have its sender.
        ForeignName = "foreign-name",
        /// Incoming: a command of a class that may not command this one.
        NotAllowed = "not-allowed",
        /// Incoming: from or for a mailbox by which routers carry packages.
        RoutersOwn = "routers-own",
        /// Incoming: no IP packet from the tunnel's address of the node that sent it to ours.
        BadPacket = "bad-packet",
    }
}

/// A count that one thread writes and any reads.
#[derive(Default, Debug)]
pub struct Count(AtomicU64);

impl Count {
    /// The present number.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    pub(crate) fn add(&self, more: u64) {
        self.set(self.get().wrapping_add(more));
    }

    pub(crate) fn take_back(&self, fewer: u64) {
        self.set(self.get().wrapping_sub(fewer));
    }

    pub(crate) fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }
}

/// What passed in one direction, and what did not.
#[derive(Debug)]
pub struct Side {
    classes: Box<[ClassCounts]>,
}

/// Counts of one class.
#[derive(Default, Debug)]
pub struct ClassCounts {
    /// Packages: taken from this node's senders; or come from other nodes, with those of which only fragments came.
    pub packages: Count,
    /// Packages sent; or delivered.
    pub passed: Count,
    /// Bytes of the bodies of those that passed.
    pub body_bytes: Count,
    lost: [Count; Cause::ALL.len()],
}

impl ClassCounts {
    /// Packages lost for a cause.
    pub fn lost(&self, cause: Cause) -> u64 {
        self.lost[cause as usize].get()
    }

    /// Packages lost for any.
    pub fn lost_in_all(&self) -> u64 {
        self.lost.iter().map(Count::get).sum()
    }
}

impl Side {
    pub(crate) fn new() -> Self {
        Self { classes: (0..=u8::MAX).map(|_| ClassCounts::default()).collect() }
    }

    /// What a class did: of the packages that went with its priority.
    pub fn class(&self, priority: Priority) -> &ClassCounts {
        &self.classes[usize::from(priority.0)]
    }

    /// All classes that did something, the most urgent first.
    pub fn classes(&self) -> impl Iterator<Item = (Priority, &ClassCounts)> {
        let all = self.classes.iter().enumerate().rev();
        all.filter(|(_, class)| class.packages.get() > 0).map(|(index, class)| (Priority(index as u8), class))
    }

    pub(crate) fn came(&self, priority: Priority) {
        self.class(priority).packages.add(1);
    }

    pub(crate) fn passed(&self, priority: Priority, body_bytes: u16) {
        let class = self.class(priority);
        class.passed.add(1);
        class.body_bytes.add(body_bytes.into());
    }

    /// What was said to have passed did not.
    pub(crate) fn came_back(&self, priority: Priority, body_bytes: u16) {
        let class = self.class(priority);
        class.passed.take_back(1);
        class.body_bytes.take_back(body_bytes.into());
    }

    pub(crate) fn lost(&self, priority: Priority, cause: Cause) {
        self.class(priority).lost[cause as usize].add(1);
    }
}

/// Datagrams to one peer.
#[derive(Default, Debug)]
#[repr(align(64))]
pub struct PeerSent {
    /// Datagrams, alive ones included: the sequence that comes next.
    pub datagrams: Count,
    /// Their bytes, as UDP's payload.
    pub bytes: Count,
    /// Packages sent whole, or with their last fragment.
    pub packages: Count,
    /// Fragments of packages.
    pub fragments: Count,
    /// Datagrams that the socket did not take; they are among `datagrams`.
    pub unsent: Count,
}

/// Datagrams from one peer.
#[derive(Default, Debug)]
#[repr(align(64))]
pub struct PeerReceived {
    /// Datagrams taken.
    pub datagrams: Count,
    /// Their bytes, as UDP's payload.
    pub bytes: Count,
    /// Packages that came whole, or with their last fragment.
    pub packages: Count,
    /// Fragments of packages.
    pub fragments: Count,
    /// Datagrams given up as lost on the wire.
    pub lost: Count,
    /// Datagrams given up, which then came nevertheless, and were taken.
    pub returned: Count,
    /// Datagrams that came before, or so late that it cannot be told; dropped.
    pub duplicates: Count,
    /// Datagrams of an earlier incarnation of the peer, or of one that is doubted; dropped.
    pub old: Count,
    /// Datagrams that came after later ones; taken.
    pub reordered: Count,
    /// Datagrams with its address that are wrong in themselves; dropped.
    pub damaged: Count,
    /// Datagrams of another version or digest, of an address that is not its, or with what has no place here, such as
    /// too many requests for parts; dropped.
    pub refused: Count,
    /// Incarnations of it that were heard, without the first.
    pub restarts: Count,
}

impl PeerReceived {
    /// Datagrams lost on the wire, as far as is known.
    pub fn missing(&self) -> u64 {
        self.lost.get().saturating_sub(self.returned.get())
    }
}

#[cfg(test)]
mod tests {
    use super::Cause;

    #[test]
    fn the_book_lists_each_cause_with_its_text() {
        let page = include_str!("../../docs/src/lan.md").lines();
        let said: Vec<&str> = page.skip_while(|line| *line != "| cause | meaning |").skip(2).collect();
        let said: Vec<&str> = said.into_iter().take_while(|line| line.starts_with('|')).collect();
        let causes = Cause::ALL.map(|cause| format!("| `{}` | {} |", cause.word(), cause.text()));
        assert_eq!(said, causes, "left: docs/src/lan.md, right: Cause");
    }
}
