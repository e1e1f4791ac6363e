//! Whether a peer is there: what the receiving half finds out, and the sending half and everyone else reads.

use crate::broken::broken;
use crate::counts::Count;
use crate::frame::{Alive, Reason};
use crate::report::Mismatch;

/// A peer to which nothing else goes is told "still there" this often.
pub const ALIVE_EVERY_NS: u64 = 200_000_000;
/// A busy peer is told what was heard of it this often.
pub const TELL_EVERY_NS: u64 = 500_000_000;
/// A peer of which nothing came for so long is silent.
pub const SILENT_AFTER_NS: u64 = 1_000_000_000;
/// A peer that says for so long that it does not hear us, does not: who has just begun is not heard at once.
pub const DENIED_FOR_NS: u64 = 1_000_000_000;
/// So long after a peer has heard us last it is unheard at the latest, if none of what it says is lost.
pub const UNHEARD_AFTER_NS: u64 = SILENT_AFTER_NS + TELL_EVERY_NS + DENIED_FOR_NS;
/// A refusal holds for so long; whoever goes on refusing says so every second.
pub const REFUSED_FOR_NS: u64 = 3_000_000_000;

/// Whether packages reach a peer, as far as is known.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// Just begun: nothing heard yet, and no time to.
    Unknown,
    /// Heard, and hears us or had no time yet to say.
    Alive,
    /// Nothing heard for a second.
    Silent,
    /// Heard, but does not hear us.
    Unheard,
    /// One of us takes nothing from the other.
    Refused(Mismatch),
}

/// One peer. Written by the thread that receives.
#[derive(Default, Debug)]
pub struct Link {
    /// When something of it came last, ns of the monotonic clock; 0: never.
    pub heard_ns: Count,
    /// Its incarnation; 0: none.
    pub incarnation: Count,
    /// Sequence that is expected next.
    pub next: Count,
    /// When it said last that it hears us, ns; 0: never.
    pub hears_us_ns: Count,
    /// When it began to say that it does not, ns; 0: it does not say so.
    pub denied_ns: Count,
    /// When it was first heard after it was not, ns.
    pub since_ns: Count,
    /// Datagrams of ours that it misses, as it says.
    pub missed_by_it: Count,
    /// When it refused us last since its configuration is another, ns; 0: never. And its digest.
    pub refuses_us_ns: Count,
    /// See `refuses_us_ns`.
    pub refuses_us_digest: Count,
    /// When it has shown last, by what was sealed, that it lives and has said what time it is by another configuration, ns; 0: never. And its
    /// digest.
    pub tells_other_ns: Count,
    /// See `tells_other_ns`.
    pub tells_other_digest: Count,
    /// When one of us refused the other last, ns; 0: never.
    refused_ns: Count,
    /// What differs: version, reason, whether a digest is known; and that.
    refused_why: Count,
    refused_digest: Count,
}

impl Link {
    /// Whether packages reach it, as a router sees it that began at `started_ns`.
    pub fn state(&self, started_ns: u64, now_ns: u64) -> State {
        let (heard_ns, refused_ns) = (self.heard_ns.get(), self.refused_ns.get());
        if refused_ns > 0 && refused_ns.saturating_add(REFUSED_FOR_NS) > now_ns {
            return State::Refused(self.mismatch());
        }
        if heard_ns.max(started_ns).saturating_add(SILENT_AFTER_NS) <= now_ns && !broken!(NeverSilent) {
            return State::Silent;
        }
        if heard_ns == 0 {
            return State::Unknown;
        }
        let denied_ns = self.denied_ns.get();
        let is_unheard = denied_ns != 0 && denied_ns.saturating_add(DENIED_FOR_NS) <= now_ns;
        if is_unheard && !broken!(NeverUnheard) { State::Unheard } else { State::Alive }
    }

    /// What to tell it of itself. `missing`: datagrams of its that never came.
    pub(crate) fn told(&self, now_ns: u64, missing: u64) -> Alive {
        if self.heard_ns.get().saturating_add(SILENT_AFTER_NS) <= now_ns {
            return Alive::default();
        }
        Alive { heard_incarnation: self.incarnation.get(), heard_next: self.next.get(), heard_lost: missing }
    }

    /// It says whether it hears us.
    pub(crate) fn hears_us(&self, now_ns: u64, hears: bool) {
        if hears {
            self.hears_us_ns.set(now_ns);
            self.denied_ns.set(0);
        } else if self.denied_ns.get() == 0 {
            self.denied_ns.set(now_ns);
        }
    }

    /// What it said of us is of another time: it is heard anew, or could not be heard.
    pub(crate) fn begin(&self, now_ns: u64) {
        self.since_ns.set(now_ns);
        self.denied_ns.set(0);
    }

    pub(crate) fn refuse(&self, now_ns: u64, mismatch: Mismatch) {
        self.refused_digest.set(mismatch.digest.unwrap_or(0));
        let known = u64::from(mismatch.digest.is_some());
        self.refused_why.set(known << 16 | u64::from(mismatch.reason as u8) << 8 | u64::from(mismatch.version));
        self.refused_ns.set(now_ns.max(1));
    }

    /// It goes by another configuration, and says that it takes nothing from us.
    pub(crate) fn refuses_us(&self, now_ns: u64, digest: u64) {
        self.refuses_us_digest.set(digest);
        self.refuses_us_ns.set(now_ns.max(1));
    }

    /// It lives, goes by another configuration, and says what time it is.
    pub(crate) fn tells_other(&self, now_ns: u64, digest: u64) {
        self.tells_other_digest.set(digest);
        self.tells_other_ns.set(now_ns.max(1));
    }

    /// What comes from it now is of our version and digest.
    pub(crate) fn accept(&self) {
        if self.refused_ns.get() != 0 {
            self.refused_ns.set(0);
        }
    }

    fn mismatch(&self) -> Mismatch {
        let why = self.refused_why.get();
        let reason = match why >> 8 & 0xff {
            1 => Reason::Version,
            2 => Reason::Digest,
            4 => Reason::Sealed,
            5 => Reason::Key,
            _ => Reason::Stranger,
        };
        let digest = (why >> 16 & 1 == 1).then(|| self.refused_digest.get());
        Mismatch { reason, version: why as u8, digest }
    }
}
