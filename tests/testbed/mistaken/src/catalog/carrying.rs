//! What a router could do wrong with packages and datagrams.

use super::planted::{Group, IN_NETWORKS, Planted};
use rohrpost_planted::{and_not, before, edit, instead, left_out, or};

pub(crate) const CARRYING: Group = Group {
    name: "CARRYING",
    text: "Mistakes of the cores that carry packages.",
    mistakes: &[
        Planted {
            name: "SkipsCheck",
            text: "Frame: the check is not compared.",
            shows_in: "frame::tests::a_flipped_bit_is_noticed",
            edits: &[and_not("frame/mod.rs", "if b[CHECK] != check(b, &[rest]).to_le_bytes()")],
        },
        Planted {
            name: "IgnoresLevels",
            text: "Queue: the package that has waited longest leaves first, whatever its level.",
            shows_in: "queue::tests::urgent_ones_go_first_and_equal_ones_in_order",
            edits: &[before(
                "queue/mod.rs",
                "let level = bits(self.levels.into()).find(|level| self.busy[*level] & peers != 0)?;",
                "let firsts = self.peers.iter().flatten().filter_map(List::first); return firsts.min_by_key(|place| self.entries[*place as usize].ticket).map(Place);",
            )],
        },
        Planted {
            name: "TakesNewest",
            text: "Queue: the newest package of a level leaves first.",
            shows_in: "outbound::tests::levels_go_in_order_and_datagrams_are_filled",
            edits: &[instead("queue/mod.rs", "list.first()", "list.last()")],
        },
        Planted {
            name: "SharesQuota",
            text: "Queue: a sender may use up the memory of all.",
            shows_in: "queue::tests::no_sender_uses_up_anothers_memory",
            edits: &[instead(
                "queue/mod.rs",
                "self.quota_blocks",
                "self.entries.len() as u32 - self.used_blocks + own.used",
            )],
        },
        Planted {
            name: "DisplacesOldest",
            text: "Queue: the oldest package gives way in place of the newest.",
            shows_in: "queue::tests::a_sender_over_its_quota_loses_its_own_least_important_and_newest",
            edits: &[edit(
                "queue/mod.rs",
                "let Some(last) = self.senders[sender].levels[lower..].iter().rev().find_map(List::last) else { return false };",
                r"let end = if broken!(DisplacesOldest) { List::first } else { List::last };
        let Some(last) = self.senders[sender].levels[lower..].iter().rev().find_map(end) else { return false };",
            )],
        },
        Planted {
            name: "ForgetsDisplaced",
            text: "Queue: a displaced package is not reported.",
            shows_in: "queue::tests::every_package_that_gives_way_is_told",
            edits: &[left_out("queue/mod.rs", "gone(&waiting, beginning);")],
        },
        Planted {
            name: "AlwaysAlone",
            text: "Sending: each package leaves in a datagram of its own, whatever waits behind it.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "driver/free.rs",
                "transmitter.accept(outlet, package, taken == 0 && is_alone());",
                "transmitter.accept(outlet, package, broken!(AlwaysAlone) || (taken == 0 && is_alone()));",
            )],
        },
        Planted {
            name: "NeverStops",
            text: "Sending: the mailbox is emptied however much waits in the queue.",
            shows_in: IN_NETWORKS,
            edits: &[and_not("driver/free.rs", "if accepts && on.outlet().queue().0.has_plenty()")],
        },
        Planted {
            name: "Unpaced",
            text: "Outbound: the bytes a second have no limit.",
            shows_in: "outbound::tests::the_rate_is_kept",
            edits: &[or("outbound/pace.rs", "if from_ns <= now_ns")],
        },
        Planted {
            name: "NeverInAdvance",
            text: "Outbound: a package that is more important than the last one waits for the pace as well.",
            shows_in: "outbound::tests::what_is_more_important_than_a_flood_does_not_wait_for_the_pace",
            edits: &[and_not("outbound/pace.rs", "let hurries = level < self.level")],
        },
        Planted {
            name: "Hurries",
            text: "Outbound: a package keeps a priority above that of its sender or its request.",
            shows_in: "outbound::tests::a_package_is_no_more_urgent_than_its_sender_or_its_caller",
            edits: &[edit(
                "outbound/accept.rs",
                "self.accept_capped(now_ns, &Package { head, ..*package }, alone, report)",
                r"let head = if broken!(Hurries) { package.head } else { head };
        self.accept_capped(now_ns, &Package { head, ..*package }, alone, report)",
            )],
        },
        Planted {
            name: "SendsStale",
            text: "Outbound: a package that waited too long leaves nevertheless.",
            shows_in: "outbound::tests::what_waits_too_long_is_dropped",
            edits: &[and_not("outbound/mod.rs", "now_ns.saturating_sub(published_ns) > WAIT_MAX_NS")],
        },
        Planted {
            name: "NeverSilent",
            text: "Link: no peer is ever silent.",
            shows_in: "inbound::tests::incarnations::a_peer_without_a_datagram_for_a_second_is_silent",
            edits: &[and_not("link.rs", "if heard_ns.max(started_ns).saturating_add(SILENT_AFTER_NS) <= now_ns")],
        },
        Planted {
            name: "NeverUnheard",
            text: "Link: no peer is ever deaf to this node.",
            shows_in: "inbound::tests::incarnations::a_one_way_link_is_noticed",
            edits: &[and_not("link.rs", "if is_unheard")],
        },
        Planted {
            name: "ReportsDelivered",
            text: "Inbound: a package is reported as not delivered, and is delivered.",
            shows_in: "inbound::tests::names::a_node_speaks_for_its_own_names_alone",
            edits: &[edit(
                "inbound/peer.rs",
                "Ok(()) => self.stats.inn.passed(head.priority, head.len),",
                r"Ok(()) => {
                if broken!(ReportsDelivered) {
                    deliver.lost(Some(self.from), head, body, Cause::MailboxFull);
                }
                self.stats.inn.passed(head.priority, head.len);
            }",
            )],
        },
        Planted {
            name: "TakesCopies",
            text: "Inbound: duplicates are taken.",
            shows_in: "inbound::tests::a_window_knows_gaps_and_copies",
            edits: &[and_not("inbound/window.rs", "if self.is_duplicate(sequence)")],
        },
        Planted {
            name: "CountsNoGaps",
            text: "Inbound: missing datagrams are not counted.",
            shows_in: "inbound::tests::a_window_knows_gaps_and_copies",
            edits: &[edit(
                "inbound/window.rs",
                "let lost = (self.settled..until).filter(|sequence| !self.has(*sequence)).count() as u64;",
                r"let lost =
            (self.settled..until).filter(|sequence| !self.has(*sequence) && !broken!(CountsNoGaps)).count() as u64;",
            )],
        },
        Planted {
            name: "TakesLate",
            text: "Inbound: a package older than the last one of its flow is delivered.",
            shows_in: "inbound::tests::what_is_older_than_what_was_delivered_is_late",
            edits: &[
                and_not("fragment/mod.rs", "older.is_late |= flow(&older.head) == flow(newer)"),
                and_not("inbound/order.rs", "Some((last, _)) => mark <= *last"),
            ],
        },
        Planted {
            name: "ForgetsFloor",
            text: "Inbound: a flow without a place in the table is not ordered.",
            shows_in: "inbound::tests::a_full_table_costs_packages_but_not_the_order",
            edits: &[and_not("inbound/order.rs", "None => mark <= group.floor")],
        },
        Planted {
            name: "TakesOldIncarnations",
            text: "Inbound: datagrams of earlier incarnations are taken.",
            shows_in: "inbound::tests::incarnations::a_restarted_peer_is_known_by_its_incarnation",
            edits: &[or("inbound/peer.rs", "let may_go_on = first.is_some() || (is_silent && goes_on)")],
        },
        Planted {
            name: "TakesOtherDigests",
            text: "Inbound: nodes of another configuration are not refused.",
            shows_in: "inbound::tests::refusals::another_configuration_is_refused_and_told",
            edits: &[and_not("inbound/refusing.rs", "if head.digest != ours.digest")],
        },
        Planted {
            name: "TakesStale",
            text: "Inbound: a datagram that waited too long in the socket is delivered.",
            shows_in: "inbound::tests::incarnations::what_waited_in_the_socket_is_not_delivered",
            edits: &[and_not("inbound/mod.rs", "let is_old = now_ns.saturating_sub(came.arrived_ns) > SOCKET_MAX_NS")],
        },
        Planted {
            name: "MixesPackages",
            text: "Fragment: fragments of different packages of a flow are put together.",
            shows_in: "fragment::tests::packages_of_several_levels_come_between_each_other",
            edits: &[edit(
                "fragment/mod.rs",
                "let is_its = |partial: &Partial| partial.first == part.first;",
                r"let is_its =
            |partial: &Partial| partial.first == part.first || broken!(MixesPackages) && partial.head == part.head;",
            )],
        },
        Planted {
            name: "CountsPartsTwice",
            text: "Fragment: a fragment that comes twice counts twice.",
            shows_in: "fragment::tests::a_part_counts_once",
            edits: &[and_not("fragment/mod.rs", "if !agrees || self.came[word] & bit != 0")],
        },
        Planted {
            name: "KeepsParts",
            text: "Fragment: no package is given up for its age.",
            shows_in: "fragment::tests::what_is_missing_for_a_second_is_given_up",
            edits: &[and_not(
                "fragment/mod.rs",
                "if partial.is_used && now_ns.saturating_sub(partial.touched_ns) >= PATIENCE_NS",
            )],
        },
        Planted {
            name: "Unbounded",
            text: "Fragment: as many packages are put together at a time as have begun.",
            shows_in: "fragment::tests::memory_is_bounded_and_the_least_important_gives_way",
            edits: &[or("fragment/mod.rs", "if self.partial.len() < PARTIAL_MAX")],
        },
        Planted {
            name: "TakesFormerHolders",
            text: "Settings: what a former holder of a lease sends under its name is taken.",
            shows_in: "moving::tests::packages_go_to_the_holder_and_come_from_it_alone",
            edits: &[or("settings.rs", "self.moving.node_of(head.from).is_none()")],
        },
    ],
};
