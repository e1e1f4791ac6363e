//! How much is said of a module that ends again and again: the first end whole, some more in a line each unless they
//! have another cause, then one line for many, at growing intervals. Knows no process; time comes as an argument.

use std::time::{Duration, Instant};

/// Ends in a row that are reported each: all that the usual policy allows.
const EACH: u32 = 5;
/// Then the tenth is told, the twentieth, the fortieth and so on, and one after this time at the latest.
const LATEST: Duration = Duration::from_secs(600);
/// An end for another cause is told whole too, so often at most.
const OTHER_EVERY: Duration = Duration::from_secs(10);

/// What is said of an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tell {
    /// All that is known of it, and that so many before it were not told.
    Whole(u32),
    /// One line: what there is to know was told of the end before.
    AsBefore,
    /// One line for so many ends, this one and those that were not told, in so much time.
    Sum(u32, Duration),
    /// Nothing.
    Nothing,
}

/// The ends of one module, as far as they were told.
#[derive(Default)]
pub(super) struct Repeats {
    /// Cause of the end that was reported in full last, as [`comparable`].
    cause: String,
    told_at: Option<Instant>,
    untold: u32,
    /// The end in a row that is told next.
    next: u32,
    is_quiet: bool,
}

impl Repeats {
    /// The module has ended for so many times in a row, and is started again.
    pub(super) fn ended(&mut self, in_a_row: u32, cause: &str, now: Instant) -> Tell {
        let cause = comparable(cause);
        let passed = self.told_at.map_or(Duration::MAX, |at| now.saturating_duration_since(at));
        let is_other = cause != self.cause && passed >= OTHER_EVERY;
        self.is_quiet = in_a_row >= EACH;
        let tell = if (2..=EACH).contains(&in_a_row) && cause == self.cause {
            Tell::AsBefore
        } else if in_a_row <= EACH || is_other {
            self.cause = cause;
            Tell::Whole(self.untold)
        } else if in_a_row >= self.next || passed >= LATEST {
            Tell::Sum(self.untold + 1, passed)
        } else {
            self.untold += 1;
            return Tell::Nothing;
        };
        (self.untold, self.told_at, self.next) = (0, Some(now), in_a_row.max(EACH) * 2);
        tell
    }

    /// The module has ended, and is not started again.
    pub(super) fn is_over(&mut self) -> Tell {
        Tell::Whole(std::mem::take(self).untold)
    }

    /// Whether it has ended so often in a row that what its next process says in its first moments has been told.
    pub(super) fn is_quiet(&self) -> bool {
        self.is_quiet
    }
}

/// A cause without what differs from end to end: process ids, times, addresses, temporary names. Each word with a digit
/// becomes one mark.
fn comparable(cause: &str) -> String {
    let in_word = |letter: char| letter.is_alphanumeric() || matches!(letter, '-' | '_' | '.');
    let words = cause.split_inclusive(|letter| !in_word(letter));
    // Each is a word and the letter behind it, or that letter alone.
    let marked = words.map(|word| match word.contains(|letter: char| letter.is_ascii_digit()) {
        true => format!("#{}", word.trim_start_matches(in_word)),
        false => word.to_owned(),
    });
    marked.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told of ends `every` so often, of which the first is number 1.
    fn told(ends: u32, every: Duration, cause: impl Fn(u32) -> String) -> Vec<(u32, Tell)> {
        let (mut repeats, start) = (Repeats::default(), Instant::now());
        let all = (1..=ends).map(|end| (end, repeats.ended(end, &cause(end), start + every * end)));
        all.filter(|(_, tell)| *tell != Tell::Nothing).collect()
    }

    #[test]
    fn the_first_end_is_told_whole_the_next_in_short_and_then_fewer_and_fewer() {
        let second = Duration::from_secs(1);
        let sum = |end, times| (end, Tell::Sum(times, second * times));
        let each = (1..=5).map(|end| (end, if end == 1 { Tell::Whole(0) } else { Tell::AsBefore }));
        let sums = [sum(10, 5), sum(20, 10), sum(40, 20), sum(80, 40), sum(160, 80)];
        let expected: Vec<_> = each.chain(sums).collect();
        assert_eq!(told(200, second, |end| format!("ended with 1\n    process {end}")), expected);
    }

    #[test]
    fn nobody_waits_long_for_the_next_line() {
        let all = told(10_000, Duration::from_secs(9), |_| "ended with 1".into());
        assert_eq!(all.last(), Some(&(9996, Tell::Sum(67, Duration::from_secs(603)))));
        assert!(all.len() < 160, "{}", all.len());
    }

    #[test]
    fn another_cause_is_told_whole_but_two_that_take_turns_do_not_flood() {
        let all = told(100, Duration::from_secs(1), |end| if end < 33 { "no disk" } else { "no wheels" }.into());
        assert!(all.contains(&(33, Tell::Whole(12))), "{all:?}");
        let all = told(100, Duration::from_secs(1), |end| if end % 2 == 0 { "no disk" } else { "no wheels" }.into());
        assert!(all.len() <= 5 + 10, "{all:?}");
    }

    #[test]
    fn addresses_and_temporary_names_are_no_other_cause() {
        let cause = |end: u32| {
            let random = end.wrapping_mul(0x9e37_79b9);
            format!(
                "killed by signal 6\n  free(): invalid pointer: 0x7ffe{random:08x} in /tmp/run-{random:x}/map, \
                 job {random:08x}-beef-{:04x}-cafe, [{}.{end:06}s]",
                random >> 16,
                end * 7
            )
        };
        let all = told(200, Duration::from_secs(11), cause);
        let whole = all.iter().filter(|(_, tell)| matches!(tell, Tell::Whole(_))).count();
        assert_eq!(whole, 1, "{all:?}");
        assert_ne!(comparable("bad pointer 0x7f in map"), comparable("bad pointer 0x7f in wheels"));
        assert_eq!(comparable("a 0x7f, b-1c: 9\n"), "a #, #: #\n");
    }

    #[test]
    fn one_that_worked_for_long_or_is_given_up_is_told_whole() {
        let (mut repeats, now) = (Repeats::default(), Instant::now());
        assert_eq!(repeats.ended(7, "no disk", now), Tell::Whole(0));
        assert_eq!(repeats.ended(8, "no disk", now), Tell::Nothing);
        assert!(repeats.is_quiet());
        assert_eq!(repeats.ended(1, "no disk", now), Tell::Whole(1));
        assert!(!repeats.is_quiet());
        assert_eq!(repeats.ended(9, "no disk", now), Tell::Nothing);
        assert_eq!(repeats.is_over(), Tell::Whole(1));
        assert!(!repeats.is_quiet());
    }
}
