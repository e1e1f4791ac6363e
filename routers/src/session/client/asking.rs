//! Questions for the time, and what their answers say besides: that the server is there.
//!
//! ```text
//!  due ─▶ waits: behind what has begun to leave ─▶ left ─ answered, or anything else comes ─▶ due
//!           │ as long as the stream moves, nobody is gone
//! ```

use crate::session::{ASK_EVERY_NS, SILENT_AFTER_NS, SLOW_SILENT_AFTER_NS};

/// The first questions follow each other closer: one of them is quick.
const FIRST_ASKS: u32 = 5;
const FIRST_ASK_EVERY_NS: u64 = 100_000_000;

/// Time requests of one connection.
#[derive(Debug, Default)]
pub(super) struct Asking {
    /// When the next is due, ns.
    pub(super) next_ns: u64,
    asked: u32,
    /// Where in the stream the question ends that waits for its way out.
    waits: Option<u64>,
    /// When the first left behind which nothing was heard, ns.
    left_ns: Option<u64>,
}

impl Asking {
    pub(super) fn begin(now_ns: u64) -> Self {
        Self { next_ns: now_ns, ..Self::default() }
    }

    /// Whether it is time to ask; one that has not left yet is enough.
    pub(super) fn is_due(&self, now_ns: u64) -> bool {
        now_ns >= self.next_ns && self.waits.is_none()
    }

    /// A question was made ready; it has left when the stream has taken so many bytes.
    pub(super) fn asks(&mut self, now_ns: u64, end: u64) {
        self.asked = self.asked.saturating_add(1);
        self.next_ns = now_ns + if self.asked < FIRST_ASKS { FIRST_ASK_EVERY_NS } else { ASK_EVERY_NS };
        self.waits = Some(end);
    }

    /// The stream has taken so many bytes since it began.
    pub(super) fn sent(&mut self, now_ns: u64, bytes: u64) {
        if self.waits.take_if(|end| *end <= bytes).is_some() {
            self.left_ns.get_or_insert(now_ns);
        }
    }

    /// Something came.
    pub(super) fn heard(&mut self) {
        self.left_ns = None;
    }

    /// Whether the server has not said anything for too long that it could have said. `moved_ns`: when the stream last
    /// took something.
    pub(super) fn is_silent(&self, now_ns: u64, heard_ns: u64, moved_ns: u64, is_slow: bool) -> bool {
        let after_ns = if is_slow { SLOW_SILENT_AFTER_NS } else { SILENT_AFTER_NS };
        let is_past = |past_ns: u64, after_ns: u64| now_ns.saturating_sub(past_ns) > after_ns;
        let could_ns = match (self.left_ns, self.waits) {
            (Some(left_ns), _) => left_ns,
            (None, Some(_)) => moved_ns,
            (None, None) => heard_ns,
        };
        is_past(heard_ns, after_ns) && is_past(could_ns, after_ns - ASK_EVERY_NS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_server_that_was_not_asked_yet_is_not_silent_as_long_as_the_stream_moves() {
        let mut asking = Asking::begin(0);
        assert!(asking.is_due(0));
        asking.asks(0, 1000);
        assert!(!asking.is_due(10_000 * MS), "one that waits is enough");
        for (now_ms, moved_ms, silent, why) in [
            (3400, 0, false, "not for long"),
            (3600, 0, true, "nothing came, and the stream stood still"),
            (9000, 8000, false, "the stream moves"),
            (9000, 6000, true, "it does not any more"),
        ] {
            assert_eq!(asking.is_silent(now_ms * MS, 0, moved_ms * MS, false), silent, "{why}");
        }
        asking.sent(9000 * MS, 999);
        assert!(!asking.is_due(9000 * MS), "not all of it");
        asking.sent(9000 * MS, 1000);
        assert!(!asking.is_silent(11_400 * MS, 0, 9000 * MS, false), "it has time for its answer");
        assert!(asking.is_silent(11_600 * MS, 0, 11_500 * MS, false), "whatever else leaves");
        assert!(!asking.is_silent(11_600 * MS, 0, 11_500 * MS, true), "a slow line has more time");
        assert!(asking.is_silent(16_600 * MS, 0, 16_500 * MS, true), "and not for ever");
        asking.heard();
        assert!(!asking.is_silent(12_600 * MS, 11_600 * MS, 0, false));
    }

    #[test]
    fn a_server_that_answers_nothing_any_more_is_gone_when_it_was_silent_for_long_enough() {
        let mut asking = Asking::begin(0);
        let mut now_ns = 0;
        // Asked every second, answered until the fifth.
        while !asking.is_silent(now_ns, now_ns.min(5000 * MS), now_ns, false) {
            if asking.is_due(now_ns) {
                asking.asks(now_ns, now_ns);
                asking.sent(now_ns, now_ns);
            }
            if now_ns <= 5000 * MS {
                asking.heard();
            }
            now_ns += 10 * MS;
        }
        assert!((8500..9600).contains(&(now_ns / MS)), "{} ms", now_ns / MS);
    }
}
