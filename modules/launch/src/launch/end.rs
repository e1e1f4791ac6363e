//! The end of a launch: all modules stop, the last first.
//!
//! Each is told when the one after it has ended, so that nobody loses what it needs while it goes to its safe state. A
//! module that does not end in its time is killed. From then on the next is told after moments, whether or not the one
//! before has ended: modules that hang wait beside each other, not one after the other. The same holds when the whole
//! has taken too long. So the end comes within [`IN_ORDER_MAX`], the longest `stop-within`, and a moment for each
//! module.

use super::child::{Child, Then};
use rohrpost_mailbox::Node;
use std::time::{Duration, Instant};

/// The order is kept for so long, if all end in their time.
const IN_ORDER_MAX: Duration = Duration::from_secs(10);
/// Then the next one is told after this time.
const MOMENT: Duration = Duration::from_millis(100);
/// A second word to stop counts only when it comes so much later: programs that pass a Ctrl-C on send it twice.
const HASTE_AFTER: Duration = Duration::from_millis(300);

/// How far the end has come.
pub(super) struct LaunchShutdown {
    began: Instant,
    /// Children from here on were told.
    told: usize,
    /// The last of them was told then.
    told_at: Instant,
    /// The order cannot be waited for any more.
    disorder: bool,
    /// Words to stop that came before.
    words: u32,
}

impl LaunchShutdown {
    pub(super) fn begin(children: &mut [Child], words: u32, now: Instant) -> Self {
        children.iter_mut().for_each(Child::begin_last_incarnation);
        Self { began: now, told: children.len(), told_at: now, disorder: false, words }
    }

    /// Moves the end on, after `step` has looked after each child. `words` counts the words to stop so far.
    pub(super) fn step(&mut self, children: &mut [Child], node: &Node, words: u32, now: Instant) -> Option<String> {
        self.disorder |= children.iter().any(Child::overran) || now - self.began > IN_ORDER_MAX;
        while self.told > 0 && self.may_tell_next(children, now) {
            self.told -= 1;
            self.told_at = now;
            children[self.told].tell_to_end(Then::End, node, now);
        }
        let hasten = words != self.words && now - self.began >= HASTE_AFTER;
        self.words = words;
        if !hasten {
            return None;
        }
        self.told = 0;
        let kill = |child: &mut Child| {
            child.tell_to_end(Then::End, node, now);
            child.force(node, now).then(|| child.text().to_owned())
        };
        let killed: Vec<String> = children.iter_mut().filter_map(kill).collect();
        (!killed.is_empty()).then(|| format!("told to stop a second time; killed at once: {}", killed.join(", ")))
    }

    fn may_tell_next(&self, children: &[Child], now: Instant) -> bool {
        let before = children.get(self.told);
        before.is_none_or(Child::is_gone) || self.disorder && now >= self.told_at + MOMENT
    }

    /// Whether all were told, and have ended or are left behind.
    pub(super) fn is_over(&self, children: &[Child]) -> bool {
        self.told == 0 && children.iter().all(Child::is_gone)
    }
}
