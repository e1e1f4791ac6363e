//! What a router could reject though nothing is wrong with it: one datagram of a hundred, or what the wire
//! reordered: that happens only before the last fault, so nothing of it is lost when all must be well.

use super::planted::{Group, IN_NETWORKS, Planted};
use rohrpost_planted::edit;

pub(crate) const REJECTING: Group = Group {
    name: "REJECTING",
    text: "Mistakes of a router that rejects too much.",
    mistakes: &[
        Planted {
            name: "RejectsAsDamaged",
            text: "Inbound: one frame of a hundred is taken for damaged.",
            shows_in: "inbound::tests::a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it",
            edits: &[edit(
                "inbound/mod.rs",
                "Ok((head, frame)) => match self.mismatch(source, &head) {",
                r"Ok((head, _)) if broken!(RejectsAsDamaged) && head.sequence.is_multiple_of(100) => self.damaged(source),
            Ok((head, frame)) => match self.mismatch(source, &head) {",
            )],
        },
        Planted {
            name: "RejectsAsForeign",
            text: "Inbound: one frame of a hundred is refused, as from an address that no node has.",
            shows_in: "inbound::tests::a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it",
            edits: &[edit(
                "inbound/refusing.rs",
                "(!is_known).then(",
                "(!is_known || (broken!(RejectsAsForeign) && head.sequence.is_multiple_of(100))).then(",
            )],
        },
        Planted {
            name: "RejectsAsOld",
            text: "Inbound: a frame that was reordered is taken for one of an incarnation that is over.",
            shows_in: "inbound::tests::a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it",
            edits: &[edit(
                "inbound/peer.rs",
                "return first.is_some() || self.is_plausible(now_ns, head, is_silent);",
                r"if broken!(RejectsAsOld) && head.sequence < self.window.next() {
                return false;
            }
            return first.is_some() || self.is_plausible(now_ns, head, is_silent);",
            )],
        },
        Planted {
            name: "RejectsAsDuplicate",
            text: "Inbound: one frame of a hundred is taken for a duplicate.",
            shows_in: "inbound::tests::a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it",
            edits: &[edit(
                "inbound/peer.rs",
                "way.peer.link.next.set(self.window.next());",
                r"way.peer.link.next.set(self.window.next());
        let is_wrong = broken!(RejectsAsDuplicate) && sequence.is_multiple_of(100);
        let arrival = if is_wrong { Arrival::Duplicate } else { arrival };",
            )],
        },
        Planted {
            name: "RejectsAsLate",
            text: "Inbound: packages of one frame of a hundred are late, whatever was delivered before.",
            shows_in: "inbound::tests::a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it",
            edits: &[edit(
                "inbound/order.rs",
                "let is_late = self.is_late(head, position);",
                r"let is_wrong = broken!(RejectsAsLate) && sequence_of(position).is_multiple_of(100);
        let is_late = self.is_late(head, position) || is_wrong;",
            )],
        },
        Planted {
            name: "RejectsAsOtherIncarnation",
            text: "Security: one datagram of a hundred is taken for one of another incarnation.",
            shows_in: "security::tests::sealed::each_opens_once_in_whatever_order_within_the_window",
            edits: &[edit(
                "security/opening.rs",
                "let heard = heard.filter(|heard| heard.incarnation == head.incarnation).ok_or_else(|| {",
                r"let is_wrong = broken!(RejectsAsOtherIncarnation) && head.sequence.is_multiple_of(100);
        let is_of = |heard: &&mut HeardIncarnation| heard.incarnation == head.incarnation && !is_wrong;
        let heard = heard.filter(is_of).ok_or_else(|| {",
            )],
        },
        Planted {
            name: "RejectsAsReplay",
            text: "Security: one datagram of a hundred is taken for a replay.",
            shows_in: "security::tests::sealed::each_opens_once_in_whatever_order_within_the_window",
            edits: &[edit(
                "security/opening.rs",
                "let text = heard.seals[key].open(seal::of_sequence(head.sequence), datagram)",
                r"if broken!(RejectsAsReplay) && head.sequence.is_multiple_of(100) {
            return Err(Rejection::Replay.into());
        }
        let text = heard.seals[key].open(seal::of_sequence(head.sequence), datagram)",
            )],
        },
        Planted {
            name: "RejectsAsForged",
            text: "Security: a datagram that was reordered is taken for a forged one.",
            shows_in: "security::tests::sealed::each_opens_once_in_whatever_order_within_the_window",
            edits: &[edit(
                "security/opening.rs",
                "// What the network lost is another's to count.",
                r"if broken!(RejectsAsForged) && head.sequence < heard.window.next() {
            return Err(Rejection::Forged.into());
        }
        // What the network lost is another's to count.",
            )],
        },
        Planted {
            name: "IgnoresSyncs",
            text: "Time: one Sync of a hundred is taken for a late one.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "time/clock/slave.rs",
                "let is_contested = self.is_contested(received.ns);",
                r"if broken!(IgnoresSyncs) && head.sequence.is_multiple_of(100) {
            return Err(Ignored::Late);
        }
        let is_contested = self.is_contested(received.ns);",
            )],
        },
        Planted {
            name: "RejectsAddress",
            text: "Time: one frame of a hundred is taken for one from a wrong address.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "driver/clock.rs",
                "let is_from_its_node = addresses.get(usize::from(head.from)) == Some(&came.source);",
                r"let is_wrong = broken!(RejectsAddress) && head.sequence.is_multiple_of(100);
        let is_from_its_node = addresses.get(usize::from(head.from)) == Some(&came.source) && !is_wrong;",
            )],
        },
    ],
};
