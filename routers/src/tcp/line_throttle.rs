//! Lines about what others bring about: of one cause at most one a second, with how many were held back, so that nobody
//! can fill a log.

use crate::session::frame::SessionRefusalReason;
use rohrpost_mailbox::Throttle;

/// Interval between two lines of one cause.
const EVERY_NS: u64 = 1_000_000_000;
/// Clients of a robot come and go together: so many are named one by one.
const AT_ONCE: u32 = 16;

/// Subject of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Topic {
    /// A client takes part.
    Joined,
    /// It does not any more.
    Left(Option<SessionRefusalReason>),
    /// A connection may not take part.
    Refused(SessionRefusalReason),
    /// It cannot be sealed.
    Unsealed,
    /// A client may not host what it says.
    Objected,
    /// No connection can be accepted.
    Accept,
}

impl Topic {
    const fn at_once(self) -> u32 {
        match self {
            Self::Joined | Self::Left(_) => AT_ONCE,
            Self::Refused(_) | Self::Unsealed | Self::Objected | Self::Accept => 1,
        }
    }
}

/// Lines that are held back. There are as many causes as [`Topic`] has values.
#[derive(Default)]
pub(super) struct LineThrottle {
    causes: Vec<Cause>,
    /// Lines held back so far.
    pub(super) held: u64,
}

struct Cause {
    topic: Topic,
    throttle: Throttle,
    /// The last line that was held back.
    last: String,
}

impl LineThrottle {
    /// The line as it is to be said now, or none: then it is held back.
    pub(super) fn line(&mut self, now_ns: u64, topic: Topic, line: &str) -> Option<String> {
        let at = self.causes.iter().position(|cause| cause.topic == topic).unwrap_or_else(|| {
            self.causes.push(Cause { topic, throttle: Throttle::default(), last: String::new() });
            self.causes.len() - 1
        });
        let cause = &mut self.causes[at];
        let lines = cause.throttle.note_burst(now_ns, EVERY_NS, topic.at_once());
        if lines.is_none() {
            self.held += 1;
            line.clone_into(&mut cause.last);
        }
        lines.map(|lines| counted(line, lines))
    }

    /// The next line that was held back and may be said by now.
    pub(super) fn next_held(&mut self, now_ns: u64) -> Option<(Topic, String)> {
        self.causes.iter_mut().find_map(|cause| {
            let lines = cause.throttle.take_due(now_ns, EVERY_NS, cause.topic.at_once())?;
            Some((cause.topic, counted(&cause.last, lines)))
        })
    }
}

/// A line that stands for so many.
fn counted(line: &str, lines: u64) -> String {
    match lines - 1 {
        0 => line.to_owned(),
        held => format!("{line} ({held} more such lines before it were held back)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_flood_of_failures_is_a_line_a_second_that_counts_the_others() {
        let mut throttle = LineThrottle::default();
        let mut said = Vec::new();
        for at_ms in 0..3500_u64 {
            let now_ns = 5 * S + at_ms * 1_000_000;
            let line = format!("connection {at_ms}");
            said.extend(throttle.line(now_ns, Topic::Refused(SessionRefusalReason::Damaged), &line));
            if at_ms % 200 == 0 {
                said.extend(throttle.next_held(now_ns).map(|(_, line)| line));
            }
        }
        assert_eq!(said.len(), 4, "{said:#?}");
        assert_eq!(said[0], "connection 0");
        assert!(said[1].contains("999 more such lines"), "{}", said[1]);
        assert_eq!(throttle.held, 3496);
        // Behind the flood its last line comes as well.
        assert_eq!(throttle.next_held(8 * S), None);
        let (_, last) = throttle.next_held(30 * S).unwrap();
        assert!(last.starts_with("connection 3499 (498 more"), "{last}");
        assert_eq!(throttle.next_held(30 * S), None);
        assert_eq!(
            throttle.line(30 * S + 1, Topic::Refused(SessionRefusalReason::Damaged), "one"),
            None,
            "just said one"
        );
    }

    #[test]
    fn causes_do_not_hold_each_other_back_and_clients_that_come_together_are_named() {
        let mut throttle = LineThrottle::default();
        let joined = (0..40).filter(|_| throttle.line(S, Topic::Joined, "joins").is_some()).count();
        assert_eq!(joined, AT_ONCE as usize);
        for topic in [Topic::Unsealed, Topic::Objected, Topic::Left(None), Topic::Refused(SessionRefusalReason::Full)] {
            assert!(throttle.line(S, topic, "first of its cause").is_some());
        }
    }
}
