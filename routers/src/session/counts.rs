//! Counts of one end of sessions: each package comes, and passes, is replaced by a newer one, or is lost with a cause.

use crate::counts::{self, Count};
use crate::report::NotDelivered;
use rohrpost_mailbox::Priority;

rohrpost_mailbox::causes! {
    /// Why a package was lost at one end of a session.
    pub enum Cause {
        /// Nobody hosts its mailbox.
        NoRoute = "no-route",
        /// Too much waited, and this was the least important and newest.
        Full = "full",
        /// Too much waited, of its sender more than of others.
        Share = "share",
        /// It was under way for too long.
        Stale = "stale",
        /// It waited for a client that has gone.
        Gone = "gone",
        /// It waited for the server, which is not reached.
        Offline = "offline",
        /// It was handed on too often: it goes round.
        Hops = "hops",
        /// Its sending client does not host its sender's name.
        Foreign = "foreign",
        /// Nobody has its mailbox open.
        NoMailbox = "no-mailbox",
        /// Its mailbox was full.
        MailboxFull = "mailbox-full",
        /// Its mailbox has smaller slots.
        TooLarge = "too-large",
        /// Its sender may not command it.
        NotAllowed = "not-allowed",
        /// It is from or for a mailbox by which routers carry packages, or for a router of another system.
        RoutersOwn = "routers-own",
    }
}

impl Cause {
    /// The refusal that the sender of a command gets, as from a router on the LAN. None: no refusal, since the name may
    /// not be the true sender's.
    pub const fn told(self) -> Option<counts::Cause> {
        Some(match self {
            Self::NoRoute | Self::Hops => counts::Cause::NoRoute,
            Self::Full | Self::Share => counts::Cause::Quota,
            Self::Stale => counts::Cause::Stale,
            Self::Gone | Self::Offline => counts::Cause::Silent,
            Self::Foreign => return None,
            Self::NoMailbox => counts::Cause::NoMailbox,
            Self::MailboxFull => counts::Cause::MailboxFull,
            Self::TooLarge => counts::Cause::TooLarge,
            Self::NotAllowed => counts::Cause::NotAllowed,
            Self::RoutersOwn => counts::Cause::RoutersOwn,
        })
    }
}

impl From<NotDelivered> for Cause {
    fn from(why: NotDelivered) -> Self {
        match why {
            NotDelivered::NoMailbox => Self::NoMailbox,
            NotDelivered::MailboxFull => Self::MailboxFull,
            NotDelivered::TooLarge => Self::TooLarge,
        }
    }
}

/// What passed, and what did not, by class.
#[derive(Debug)]
pub struct SessionCounts {
    classes: Box<[SessionClassCounts]>,
}

/// Counts of one class.
#[derive(Default, Debug)]
pub struct SessionClassCounts {
    /// Packages that came; one to all systems once for each of them.
    pub packages: Count,
    /// Packages handed to the next connection; at a client, delivered ones.
    pub passed: Count,
    /// Packages of newest-only data that a newer one replaced while they waited.
    pub replaced: Count,
    lost: [Count; Cause::ALL.len()],
}

impl SessionClassCounts {
    /// Packages lost for a cause.
    pub fn lost(&self, cause: Cause) -> u64 {
        self.lost[cause as usize].get()
    }

    /// Packages lost for any.
    pub fn lost_in_all(&self) -> u64 {
        self.lost.iter().map(Count::get).sum()
    }

    /// Packages of which it is known what became of them; the others wait.
    pub fn settled(&self) -> u64 {
        self.passed.get() + self.replaced.get() + self.lost_in_all()
    }
}

impl Default for SessionCounts {
    fn default() -> Self {
        Self { classes: (0..=u8::MAX).map(|_| SessionClassCounts::default()).collect() }
    }
}

impl SessionCounts {
    /// What a class did.
    pub fn class(&self, priority: Priority) -> &SessionClassCounts {
        &self.classes[usize::from(priority.0)]
    }

    /// All classes that did something, the most urgent first.
    pub fn classes(&self) -> impl Iterator<Item = (Priority, &SessionClassCounts)> {
        let all = self.classes.iter().enumerate().rev();
        all.filter(|(_, class)| class.packages.get() > 0).map(|(index, class)| (Priority(index as u8), class))
    }

    /// Packages of all classes lost for a cause.
    pub fn lost_for(&self, cause: Cause) -> u64 {
        self.classes.iter().map(|class| class.lost(cause)).sum()
    }

    pub(crate) fn came(&self, priority: Priority) {
        self.class(priority).packages.add(1);
    }

    pub(crate) fn passed(&self, priority: Priority) {
        self.class(priority).passed.add(1);
    }

    pub(crate) fn replaced(&self, priority: Priority) {
        self.class(priority).replaced.add(1);
    }

    pub(crate) fn lost(&self, priority: Priority, cause: Cause) {
        self.class(priority).lost[cause as usize].add(1);
    }
}
