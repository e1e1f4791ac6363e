//! What a router could do wrong with what strangers and other nodes send.

use super::planted::{Group, Planted};
use rohrpost_planted::{and_not, edit, instead, or};

pub(crate) const ADMISSION: Group = Group {
    name: "ADMISSION",
    text: "Mistakes of admission.",
    mistakes: &[
        Planted {
            name: "AdmitsHurry",
            text: "Admission: a package keeps the priority that its sender wrote.",
            shows_in: "inbound::tests::names::no_package_of_another_node_hurries_more_than_it_may",
            edits: &[
                instead("inbound/mod.rs", "capped(head)", "*head"),
                instead("session/client/incoming.rs", "capped(&carried.head)", "carried.head"),
            ],
        },
        Planted {
            name: "AdmitsForeignNames",
            text: "Admission: any node may send in any name.",
            shows_in: "inbound::tests::names::a_node_speaks_for_its_own_names_alone",
            edits: &[
                edit(
                    "admission/mod.rs",
                    "ArrivalPath::Lan { is_its_name: false, .. } => {",
                    "ArrivalPath::Lan { is_its_name: false, .. } if !broken!(AdmitsForeignNames) => {",
                ),
                edit(
                    "admission/mod.rs",
                    "ArrivalPath::Beyond { is_our_name } if is_our_name && !is_reply || !head.from.is_mailbox() => {",
                    r"ArrivalPath::Beyond { is_our_name }
                if (is_our_name && !is_reply || !head.from.is_mailbox()) && !broken!(AdmitsForeignNames) =>
            {",
                ),
            ],
        },
        Planted {
            name: "AdmitsRoutersOwn",
            text: "Admission: packages for a router's own mailboxes are delivered.",
            shows_in: "inbound::tests::names::a_routers_own_mailboxes_take_nothing_but_packets_of_the_tunnel",
            edits: &[
                and_not("admission/mod.rs", "if self.is_across_systems(way, head)"),
                edit(
                    "admission/mod.rs",
                    "None => Err(NotAdmitted::RoutersOwn),",
                    r"None if broken!(AdmitsRoutersOwn) => Ok(()),
            None => Err(NotAdmitted::RoutersOwn),",
                ),
            ],
        },
        Planted {
            name: "AdmitsPackets",
            text: "Admission: any body is an IP packet of the node that it comes from.",
            shows_in: "inbound::tests::names::a_routers_own_mailboxes_take_nothing_but_packets_of_the_tunnel",
            edits: &[and_not("admission/mod.rs", "Some(node) if !self.is_packet_of(node, body)")],
        },
    ],
};

pub(crate) const CROWDED: Group = Group {
    name: "CROWDED",
    text: "Mistakes that show with many flows and without reordering.",
    mistakes: &[Planted {
        name: "ForgetsBegun",
        text: "Inbound: a package in fragments is ordered by its flow's state when the last fragment comes.",
        shows_in: "inbound::tests::a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it",
        edits: &[instead("inbound/order.rs", "whole.is_late", "self.is_late(&whole.head, position)")],
    }],
};

pub(crate) const FORGED: Group = Group {
    name: "FORGED",
    text: "Mistakes that show where datagrams are forged.",
    mistakes: &[
        Planted {
            name: "BelievesIncarnations",
            text: "Inbound: a new incarnation of a peer is believed at its first datagram.",
            shows_in: "inbound::tests::incarnations::lives_that_one_datagram_each_tells_of_change_nothing",
            edits: &[and_not("inbound/peer.rs", "let is_doubted = !is_vouched_for && was.is_none() && !is_first")],
        },
        Planted {
            name: "BelievesJumps",
            text: "Inbound: a sequence number far ahead is believed at once.",
            shows_in: "inbound::tests::incarnations::one_datagram_that_is_far_ahead_changes_nothing",
            edits: &[or("inbound/peer.rs", "if !is_ahead && !is_behind")],
        },
        Planted {
            name: "TakesOtherPorts",
            text: "Inbound: what is for another port is taken for what its sender says at this one.",
            shows_in: "inbound::tests::ports::what_is_for_another_port_changes_nothing_of_its_sender",
            edits: &[and_not("inbound/mod.rs", "if !port.has_sequence(head.sequence)")],
        },
        Planted {
            name: "BelievesRefusals",
            text: "Inbound: one refusal parts this node from a peer that has just said that it hears it.",
            shows_in: "inbound::tests::refusals::refusals_of_a_peer_that_hears_us_part_nobody",
            edits: &[and_not("inbound/refusing.rs", "if heard_ns > 0 && heard_ns + SILENT_AFTER_NS > now_ns")],
        },
    ],
};

pub(crate) const LAN: Group = Group {
    name: "LAN",
    text: "Other mistakes on the LAN, which the cores' own tests show.",
    mistakes: &[
        Planted {
            name: "WaitsForOne",
            text: "Outbound: while one peer's path has no room, nothing leaves to the others.",
            shows_in: "outbound::tests::a_way_without_room_is_passed_over",
            edits: &[edit(
                "outbound/mod.rs",
                "self.reached & !self.full & self.hearing",
                "if broken!(WaitsForOne) && self.full != 0 { 0 } else { self.reached & !self.full & self.hearing }",
            )],
        },
        Planted {
            name: "OpensTwice",
            text: "Security: a datagram that was opened before is opened again.",
            shows_in: "security::tests::sealed::each_opens_once_in_whatever_order_within_the_window",
            edits: &[
                and_not("security/opening.rs", "if heard.window.is_duplicate(head.sequence)"),
                or("security/opening.rs", "debug_assert!(arrival != Arrival::Duplicate"),
            ],
        },
        Planted {
            name: "BeginsUnproven",
            text: "Security: any sender of a hello is taken to be alive.",
            shows_in: "security::tests::handshake::only_a_living_incarnation_begins",
            edits: &[or("security/handshake.rs", "let proves = self.is_answer(now_ns, peer, hello.answer)")],
        },
        Planted {
            name: "BelievesUnopened",
            text: "Security: a datagram that cannot be opened is believed to come from a peer that is heard.",
            shows_in: "security::tests::gate::a_cause_is_believed_of_the_silent_alone",
            edits: &[or("inbound/refusing.rs", "if is_away")],
        },
    ],
};
