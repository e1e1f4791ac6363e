//! Lines about what others bring about: of one cause at most one a second, with how many were held back, so that nobody
//! can fill a log.

use crate::session::frame::SessionRefusalReason;

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
pub(super) struct Hush {
    causes: Vec<Cause>,
    /// Lines held back so far.
    pub(super) held: u64,
}

struct Cause {
    topic: Topic,
    /// Lines that may be said at once.
    left: u32,
    /// When one more may be said, ns.
    next_ns: u64,
    /// Held back since the last that was said.
    held: u64,
    /// The last of them.
    last: String,
}

impl Hush {
    /// The line as it is to be said now, or none: then it is held back.
    pub(super) fn line(&mut self, now_ns: u64, topic: Topic, line: &str) -> Option<String> {
        let at = self.causes.iter().position(|cause| cause.topic == topic).unwrap_or_else(|| {
            let (left, next_ns) = (topic.at_once(), now_ns + EVERY_NS);
            self.causes.push(Cause { topic, left, next_ns, held: 0, last: String::new() });
            self.causes.len() - 1
        });
        let cause = &mut self.causes[at];
        cause.wait(now_ns);
        if cause.left == 0 {
            cause.held += 1;
            self.held += 1;
            line.clone_into(&mut cause.last);
            return None;
        }
        Some(cause.say(line))
    }

    /// The next line that was held back and may be said by now.
    pub(super) fn next_held(&mut self, now_ns: u64) -> Option<(Topic, String)> {
        self.causes.iter_mut().for_each(|cause| cause.wait(now_ns));
        let cause = self.causes.iter_mut().find(|cause| cause.held > 0 && cause.left > 0)?;
        cause.held -= 1;
        let last = std::mem::take(&mut cause.last);
        Some((cause.topic, cause.say(&last)))
    }
}

impl Cause {
    /// Time has passed.
    fn wait(&mut self, now_ns: u64) {
        let most = self.topic.at_once();
        while self.left < most && now_ns >= self.next_ns {
            self.left += 1;
            self.next_ns += EVERY_NS;
        }
        if self.left == most {
            self.next_ns = now_ns + EVERY_NS;
        }
    }

    fn say(&mut self, line: &str) -> String {
        self.left -= 1;
        match std::mem::take(&mut self.held) {
            0 => line.to_owned(),
            held => format!("{line} ({held} more such lines before it were held back)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_flood_of_failures_is_a_line_a_second_that_counts_the_others() {
        let mut hush = Hush::default();
        let mut said = Vec::new();
        for at_ms in 0..3500_u64 {
            let now_ns = 5 * S + at_ms * 1_000_000;
            let line = format!("connection {at_ms}");
            said.extend(hush.line(now_ns, Topic::Refused(SessionRefusalReason::Damaged), &line));
            if at_ms % 200 == 0 {
                said.extend(hush.next_held(now_ns).map(|(_, line)| line));
            }
        }
        assert_eq!(said.len(), 4, "{said:#?}");
        assert_eq!(said[0], "connection 0");
        assert!(said[1].contains("999 more such lines"), "{}", said[1]);
        assert_eq!(hush.held, 3496);
        // Behind the flood its last line comes as well.
        assert_eq!(hush.next_held(8 * S), None);
        let (_, last) = hush.next_held(30 * S).unwrap();
        assert!(last.starts_with("connection 3499 (498 more"), "{last}");
        assert_eq!(hush.next_held(30 * S), None);
        assert_eq!(hush.line(30 * S + 1, Topic::Refused(SessionRefusalReason::Damaged), "one"), None, "just said one");
    }

    #[test]
    fn causes_do_not_hold_each_other_back_and_clients_that_come_together_are_named() {
        let mut hush = Hush::default();
        let joined = (0..40).filter(|_| hush.line(S, Topic::Joined, "joins").is_some()).count();
        assert_eq!(joined, AT_ONCE as usize);
        for topic in [Topic::Unsealed, Topic::Objected, Topic::Left(None), Topic::Refused(SessionRefusalReason::Full)] {
            assert!(hush.line(S, topic, "first of its cause").is_some());
        }
    }
}
