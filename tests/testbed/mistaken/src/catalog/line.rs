//! What could go wrong with replicas by sessions.

use super::planted::{Group, Planted};
use rohrpost_planted::{and_not, edit, or};

pub(crate) const LINE: Group = Group {
    name: "LINE",
    text: "Mistakes with replicas by the TCP router, which simulated sessions show.",
    mistakes: &[
        Planted {
            name: "SendsInTurn",
            text: "Replication: by a session one record after the other leaves, however many newer ones there are.",
            shows_in: "session::tests::replicas::\
                       records_are_whole_or_told_and_the_newest_is_next_whatever_goes_wrong",
            edits: &[and_not("replication/destination.rs", "let behind_max = if self.by_line")],
        },
        Planted {
            name: "HoldsNothing",
            text: "Replication: a record that leaves by a session may be overwritten meanwhile.",
            shows_in: "session::tests::replicas::\
                       pictures_come_whole_by_a_line_that_is_much_too_slow_and_poses_pass_them",
            edits: &[or("replication/destination.rs", "let is_there = !self.by_line")],
        },
        Planted {
            name: "LeavesPackagesWaiting",
            text: "Session: what waits for a connection leaves when no part of a replica does.",
            shows_in: "session::tests::replicas::a_package_waits_for_one_part_at_most_and_what_the_kernel_has",
            edits: &[
                edit(
                    "session/server/mod.rs",
                    r"self.refill(now_ns, client, host);
            self.add_part(now_ns, client, host);",
                    r"if !broken!(LeavesPackagesWaiting) {
                self.refill(now_ns, client, host);
            }
            self.add_part(now_ns, client, host);
            if broken!(LeavesPackagesWaiting) && self.ready(client).is_empty() {
                self.refill(now_ns, client, host);
            }",
                ),
                edit(
                    "session/outgoing.rs",
                    r"|| (first.is_some() && self.is_part_last) {
            return false;
        }
        let before = first",
                    r"|| (first.is_some() && self.is_part_last && !broken!(LeavesPackagesWaiting)) {
            return false;
        }
        let before = first.filter(|_| !broken!(LeavesPackagesWaiting))",
                ),
                and_not("session/server/replicas.rs", "if member.part_turn == turn"),
            ],
        },
        Planted {
            name: "MissesLastPart",
            text: "Replication: a record of which one part is missing counts as whole.",
            shows_in: "session::tests::replicas::\
                       records_are_whole_or_told_and_the_newest_is_next_whatever_goes_wrong",
            edits: &[edit(
                "replication/gathering.rs",
                "(true, parts, parts - 1, now_ns);",
                "(true, parts - usize::from(broken!(MissesLastPart) && parts > 1), parts - 1, now_ns);",
            )],
        },
        Planted {
            name: "BeginsWithOlder",
            text: "Replication: a connection begins with the record before the newest.",
            shows_in: "session::tests::replicas::\
                       records_are_whole_or_told_and_the_newest_is_next_whatever_goes_wrong",
            edits: &[edit(
                "replication/destination.rs",
                "let (mut next, mut gone) = (self.next.unwrap_or(newest.sequence), 0);",
                r"let mut newest = *newest;
        if broken!(BeginsWithOlder) && self.has_none {
            newest.sequence = newest.sequence.saturating_sub(1);
        }
        let (mut next, mut gone) = (self.next.unwrap_or(newest.sequence), 0);",
            )],
        },
    ],
};
