//! What could go wrong with replicas: at their port where datagrams are sealed, and with what is left out.

use super::planted::{Group, Planted, edit};

pub(crate) const REPLICAS: Group = Group {
    name: "REPLICAS",
    text: "Mistakes with replicas, which the cores' own tests show.",
    mistakes: &[
        Planted {
            name: "SharesKeys",
            text: "Security: what is sealed for the port of replicas has the key of packages.",
            shows_in: "security::tests::sealed::what_is_sealed_for_a_port_opens_there_and_at_no_other",
            edits: &[edit(
                "security/peer_sessions.rs",
                "Self::Replicas => Purpose::Replicas,",
                r"Self::Replicas if broken!(SharesKeys) => Purpose::Packages,
            Self::Replicas => Purpose::Replicas,",
            )],
        },
        Planted {
            name: "ForgetsWhatCame",
            text: "Security: what was opened opens again when its incarnation is the present one again.",
            shows_in: "security::tests::sealed::\
                       where_no_hello_says_what_comes_first_all_opens_once_however_often_its_incarnation_begins",
            edits: &[edit(
                "security/opening.rs",
                "past[0].next = heard.window.next();",
                "past[0].next = if broken!(ForgetsWhatCame) { 0 } else { heard.window.next() };",
            )],
        },
        Planted {
            name: "FillsRoomOfSeal",
            text: "Replication: a part of a description takes the room behind it, which is for its seal.",
            shows_in: "replication::tests::sealed::of_what_was_recorded_and_altered_no_part_is_taken",
            edits: &[edit(
                "replication/sending.rs",
                "[..RECORD_PART_HEAD_BYTES + self.part_bytes];",
                r";
            let room = if broken!(FillsRoomOfSeal) { content.len() } else { RECORD_PART_HEAD_BYTES + self.part_bytes };
            let content = &mut content[..room];",
            )],
        },
        Planted {
            name: "ComparesLengths",
            text: "Replication: of two records of one length the second is taken for unchanged.",
            shows_in: "replication::tests::changed::a_record_like_the_last_one_sent_is_left_out",
            edits: &[edit(
                "replication/fingerprint.rs",
                "hasher.write(record.body());",
                r"if !broken!(ComparesLengths) {
            hasher.write(record.body());
        }",
            )],
        },
        Planted {
            name: "TrustsWhatLeft",
            text: "Replication: a node that begins anew is taken to have what went there before.",
            shows_in: "replication::tests::changed::what_may_not_have_arrived_goes_again",
            edits: &[
                edit(
                    "replication/outgoing.rs",
                    "destination.has_none = true;",
                    "destination.has_none = !broken!(TrustsWhatLeft);",
                ),
                edit(
                    "replication/destination.rs",
                    "(self.under_way, self.sent, self.before, self.begun) = (None, None, None, [None; ASKED_MAX]);",
                    r"self.sent = self.sent.filter(|_| broken!(TrustsWhatLeft));
        (self.under_way, self.before, self.begun) = (None, None, [None; ASKED_MAX]);",
                ),
            ],
        },
    ],
};
