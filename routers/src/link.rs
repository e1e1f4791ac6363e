//! Whether a peer is reachable: the receiving half finds out; the sending half and others read.

use crate::counts::Count;
use crate::frame::{Alive, RefusalReason};
use crate::report::Mismatch;

/// Keep-alive interval to a peer without other traffic.
pub const ALIVE_EVERY_NS: u64 = 200_000_000;
/// A busy peer gets a report on what was heard of it this often.
pub const TELL_EVERY_NS: u64 = 500_000_000;
/// A peer without a datagram for this long is silent.
pub const SILENT_AFTER_NS: u64 = 1_000_000_000;
/// A peer that says for this long that it does not hear us is unheard. A router that has just begun is not heard at
/// once.
pub const DENIED_FOR_NS: u64 = 1_000_000_000;
/// A peer that stopped hearing us is unheard after this long at the latest, if none of its reports is lost.
pub const UNHEARD_AFTER_NS: u64 = SILENT_AFTER_NS + TELL_EVERY_NS + DENIED_FOR_NS;
/// A refusal holds for this long; a peer that goes on refusing says so every second.
pub const REFUSED_FOR_NS: u64 = 3_000_000_000;

/// Whether packages reach a peer, as far as is known.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PeerLinkState {
    /// Just begun: nothing heard yet, and no time for it.
    Unknown,
    /// Heard, and it hears us or had no time yet to say.
    Alive,
    /// Nothing heard for a second.
    Silent,
    /// Heard, but does not hear us.
    Unheard,
    /// One of the two refuses the other.
    Refused(Mismatch),
}

/// State of one peer. The receiving thread writes.
#[derive(Default, Debug)]
pub struct Link {
    /// When its last datagram came, ns of the monotonic clock; 0: never.
    pub heard_ns: Count,
    /// Its incarnation; 0: none.
    pub incarnation: Count,
    /// The next expected sequence.
    pub next: Count,
    /// When it last said that it hears us, ns; 0: never.
    pub hears_us_ns: Count,
    /// When it began to say that it does not, ns; 0: it does not say so.
    pub denied_ns: Count,
    /// Datagrams of ours that it misses, by its report.
    pub missed_by_it: Count,
    /// When it last refused us because of the configuration, ns; 0: never. And its digest.
    pub refuses_us_ns: Count,
    /// See `refuses_us_ns`.
    pub refuses_us_digest: Count,
    /// When it was last verified and sent time of another configuration, ns; 0: never. And its digest.
    pub tells_other_ns: Count,
    /// See `tells_other_ns`.
    pub tells_other_digest: Count,
    /// When one of the two last refused the other, ns; 0: never.
    refused_ns: Count,
    /// The difference: version, reason, whether a digest is known; and that.
    refused_why: Count,
    refused_digest: Count,
}

impl Link {
    /// Whether packages reach it, for a router that began at `started_ns`.
    pub fn state(&self, started_ns: u64, now_ns: u64) -> PeerLinkState {
        let (heard_ns, refused_ns) = (self.heard_ns.get(), self.refused_ns.get());
        if refused_ns > 0 && refused_ns.saturating_add(REFUSED_FOR_NS) > now_ns {
            return PeerLinkState::Refused(self.mismatch());
        }
        if heard_ns.max(started_ns).saturating_add(SILENT_AFTER_NS) <= now_ns {
            return PeerLinkState::Silent;
        }
        if heard_ns == 0 {
            return PeerLinkState::Unknown;
        }
        let denied_ns = self.denied_ns.get();
        let is_unheard = denied_ns != 0 && denied_ns.saturating_add(DENIED_FOR_NS) <= now_ns;
        if is_unheard { PeerLinkState::Unheard } else { PeerLinkState::Alive }
    }

    /// The report for it. `missing`: its datagrams that never came.
    pub(crate) fn told(&self, now_ns: u64, missing: u64) -> Alive {
        if self.heard_ns.get().saturating_add(SILENT_AFTER_NS) <= now_ns {
            return Alive::default();
        }
        Alive { heard_incarnation: self.incarnation.get(), heard_next: self.next.get(), heard_lost: missing }
    }

    /// Its report on whether it hears us.
    pub(crate) fn hears_us(&self, now_ns: u64, hears: bool) {
        if hears {
            self.hears_us_ns.set(now_ns);
            self.denied_ns.set(0);
        } else if self.denied_ns.get() == 0 {
            self.denied_ns.set(now_ns);
        }
    }

    /// Its earlier reports are void: it is heard anew, or could not be heard.
    pub(crate) fn begin(&self) {
        self.denied_ns.set(0);
    }

    pub(crate) fn refuse(&self, now_ns: u64, mismatch: Mismatch) {
        self.refused_digest.set(mismatch.digest.unwrap_or(0));
        let known = u64::from(mismatch.digest.is_some());
        self.refused_why.set(known << 16 | u64::from(mismatch.reason as u8) << 8 | u64::from(mismatch.version));
        self.refused_ns.set(now_ns.max(1));
    }

    /// It has another configuration, and says that it refuses us.
    pub(crate) fn refuses_us(&self, now_ns: u64, digest: u64) {
        self.refuses_us_digest.set(digest);
        self.refuses_us_ns.set(now_ns.max(1));
    }

    /// It is verified, has another configuration, and sends time.
    pub(crate) fn tells_other(&self, now_ns: u64, digest: u64) {
        self.tells_other_digest.set(digest);
        self.tells_other_ns.set(now_ns.max(1));
    }

    /// Its present datagrams have our version and digest.
    pub(crate) fn accept(&self) {
        if self.refused_ns.get() != 0 {
            self.refused_ns.set(0);
        }
    }

    fn mismatch(&self) -> Mismatch {
        let why = self.refused_why.get();
        let reason = match why >> 8 & 0xff {
            1 => RefusalReason::Version,
            2 => RefusalReason::Digest,
            4 => RefusalReason::Sealed,
            5 => RefusalReason::Key,
            _ => RefusalReason::Stranger,
        };
        let digest = (why >> 16 & 1 == 1).then(|| self.refused_digest.get());
        Mismatch { reason, version: why as u8, digest }
    }
}
