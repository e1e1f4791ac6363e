//! A module's watchdog: launch looks at the process, and ends it when it hangs.

use super::ending::{ChildShutdown, EndCause};
use super::{Child, Phase};
use crate::launch::silence::{Hang, Look, Silence, Verdict};
use crate::survey::{Working, is_dumping_core, is_stopped};
use rohrpost_mailbox::{ClassTraffic, Loss, MailboxInfo, ModuleState, Node, local, monotonic_ns, saturating_sum};
use std::time::{Duration, Instant};

impl Child {
    /// When its watchdog looks again.
    pub(super) fn watchdog_looks_in(&self) -> Option<Duration> {
        let watch = self.watch.as_ref()?;
        Some(Duration::from_nanos(watch.look_at_ns().saturating_sub(monotonic_ns())))
    }

    /// Ends it if it hangs; what there is to say at once.
    pub(super) fn end_if_it_hangs(&mut self, node: &Node, now: Instant) -> Option<String> {
        let now_ns = monotonic_ns();
        if self.watch.as_ref()?.look_at_ns() > now_ns {
            return None;
        }
        // One that ends in order takes nothing more. A crash is no hang: the kernel may still write what it leaves, and
        // the end comes by itself.
        let word = self.last_word(node);
        if word.is_none_or(|word| word.state == Some(ModuleState::Stopping) || is_dumping_core(word.pid)) {
            return None;
        }
        let look = self.look(node);
        match self.watch.as_mut()?.look(look, now_ns) {
            Verdict::Fine => None,
            Verdict::Wake => {
                node.announce_death();
                None
            }
            Verdict::Hangs(hang) => {
                let cause = self.told(hang, look.is_stopped, node);
                self.end_hung(cause, node, now);
                self.press(node, now)
            }
        }
    }

    /// Ends it for a cause that others know, if it is on in the process that called them with this incarnation; whether
    /// it was.
    pub(in crate::launch) fn end_failing(&mut self, cause: &str, incarnation: u32, node: &Node, now: Instant) -> bool {
        let is_on = self.phase == Phase::Running && self.state_of(node) == Some(ModuleState::On);
        let is_meant = is_on && self.process.as_ref().is_some_and(|process| process.began_before(incarnation));
        if is_meant {
            self.end_hung(cause.to_owned(), node, now);
        }
        is_meant
    }

    fn end_hung(&mut self, cause: String, node: &Node, now: Instant) {
        let grace = self.watchdog.map_or(Duration::ZERO, |watchdog| watchdog.grace);
        self.process.iter_mut().for_each(|process| process.terminate(node));
        self.phase = Phase::Stopping;
        self.ending = Some(ChildShutdown::begin(EndCause::Hang(cause), grace, now));
    }

    fn look(&self, node: &Node) -> Look {
        let in_hand = self.last_word(node).and_then(|word| word.in_hand);
        let is_stopped = self.pid().is_some_and(is_stopped);
        Look { in_hand, is_stopped, taken: if in_hand.is_none() { self.taken(node) } else { None } }
    }

    /// How many packages it has taken so far, if more wait. Commands and data are what the loop of a module takes; what
    /// it does with mailboxes of its own is its own affair.
    fn taken(&self, node: &Node) -> Option<u64> {
        let data = self.name.with_local(local::DATA);
        let commands = self.names.iter().map(|name| name.with_local(local::COMMANDS));
        let mailboxes: Vec<MailboxInfo> = commands.chain([data]).filter_map(|name| node.look_at(name)).collect();
        let classes = mailboxes.iter().flat_map(|mailbox| &mailbox.classes);
        // One that is too old is taken, too: its receiver drops it.
        let taken = |class: &ClassTraffic| class.received.saturating_add(class.lost(Loss::Stale));
        mailboxes.iter().any(|mailbox| mailbox.depth > 0).then(|| saturating_sum(classes.map(taken)))
    }

    /// In words, behind the module's name.
    fn told(&self, hang: Hang, is_stopped: bool, node: &Node) -> String {
        let Hang { silence, lasts } = hang;
        let limit = self.watchdog.map_or(Duration::ZERO, |watchdog| watchdog.limit);
        let stopped = if is_stopped { ", stopped by a signal" } else { "" };
        let how = match silence {
            Silence::Turn(in_hand) => {
                let Working { part, .. } = Working::new(in_hand.work, lasts, node, self.names.iter().copied());
                format!("hung in {part} for {lasts:.1?}{stopped}")
            }
            Silence::Stopped => format!("hung for {lasts:.1?}{stopped}"),
            Silence::Waiting(_) => format!("hung for {lasts:.1?} and took none of the packages that wait for it"),
        };
        format!("{how} (its watchdog allows {limit:?})")
    }
}
