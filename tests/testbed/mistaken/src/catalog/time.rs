//! What a clock could do wrong.

use super::planted::{Group, IN_NETWORKS, Planted};
use rohrpost_planted::{and_not, edit, left_out, or};

pub(crate) const TIME: Group = Group {
    name: "TIME",
    text: "Mistakes of a clock that follows a master.",
    mistakes: &[
        Planted {
            name: "AnyReply",
            text: "Time: any reply is taken for the answer to the last request.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[edit(
                "time/clock/slave.rs",
                "asked.find(|asked| asked.id == reply.id &&",
                "asked.find(|asked| (asked.id == reply.id || broken!(AnyReply)) &&",
            )],
        },
        Planted {
            name: "NoDrift",
            text: "Time: the bound does not grow with age.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[edit(
                "time/clock/slave.rs",
                "if until_ns <= now_ns && self.is_held_over() {",
                r"if broken!(NoDrift) {
            self.line.restate(self.line.record().error_ns, 0);
        } else if until_ns <= now_ns && self.is_held_over() {",
            )],
        },
        Planted {
            name: "NoMasterError",
            text: "Time: the bound lacks the master's own.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[edit(
                "time/clock/slave.rs",
                "off_ns.saturating_add(master.error_ns)",
                "off_ns.saturating_add(if broken!(NoMasterError) { 0 } else { master.error_ns })",
            )],
        },
        Planted {
            name: "Steps",
            text: "Time: the time is set within an epoch, in place of slewing.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[or("time/clock/slave.rs", "if master.epoch > epoch")],
        },
        Planted {
            name: "HalfBound",
            text: "Time: half of the half delay is taken for the bound.",
            shows_in: "time::tests::nodes_agree_soon_and_are_as_exact_as_their_network",
            edits: &[edit(
                "time/clock/slave.rs",
                "let off_ns = above.max(below).unsigned_abs();",
                "let off_ns = above.max(below).unsigned_abs() / if broken!(HalfBound) { 2 } else { 1 };",
            )],
        },
        Planted {
            name: "OldSamples",
            text: "Time: measurements of an earlier master are kept.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[left_out("time/clock.rs", "self.history.clear();")],
        },
        Planted {
            name: "Stubborn",
            text: "Time: a master never yields to another.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[edit(
                "time/clock/slave.rs",
                "let heard = self.election.sync(head.from, head.incarnation, sync, received.ns, followed);",
                r"if was_master && broken!(Stubborn) {
            return Err(Ignored::Late);
        }
        let heard = self.election.sync(head.from, head.incarnation, sync, received.ns, followed);",
            )],
        },
        Planted {
            name: "SharesTerms",
            text: "Time: terms of two nodes that begin one at once are the same.",
            shows_in: "time::tests::promises_hold_in_every_scene",
            edits: &[edit(
                "time/election.rs",
                "let next = Term::new(self.highest.max(own).round().saturating_add(1), rank);",
                r"let rank = if broken!(SharesTerms) { 0 } else { rank };
        let next = Term::new(self.highest.max(own).round().saturating_add(1), rank);",
            )],
        },
        Planted {
            name: "TakesAnyAddress",
            text: "Time: a frame is taken from whatever address it comes.",
            shows_in: IN_NETWORKS,
            edits: &[
                and_not("driver/clock.rs", "} else if !is_from_its_node"),
                or("driver/clock.rs", "let is_there = |from| node == Some(from)"),
            ],
        },
    ],
};

pub(crate) const FOLLOWER: Group = Group {
    name: "FOLLOWER",
    text: "Mistakes where time comes by the TCP router.",
    mistakes: &[Planted {
        name: "TakesSmallest",
        text: "Time: of answers that contradict each other the one with the smallest bound counts.",
        shows_in: "time::follower::tests::two_times_that_cannot_both_be_true_are_a_contradiction_and_no_choice",
        edits: &[
            and_not("session/estimate.rs", "if self.contradicts(now_ns, &sample)"),
            and_not(
                "time/follower.rs",
                "if by_ns.unsigned_abs() > error_ns.saturating_add(self.line.error_ns(now_ns))",
            ),
        ],
    }],
};
