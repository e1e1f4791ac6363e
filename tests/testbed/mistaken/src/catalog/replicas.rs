//! What could go wrong with replicas: at their port where datagrams are sealed, and with what is left out.

use super::planted::{Group, IN_NETWORKS, Planted};
use rohrpost_planted::{and_not, edit, instead, left_out, or};

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
            edits: &[left_out("replication/fingerprint.rs", "hasher.write(record.body());")],
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

pub(crate) const RECORDS: Group = Group {
    name: "RECORDS",
    text: "Mistakes with records, which simulated networks show.",
    mistakes: &[
        Planted {
            name: "PublishesIncomplete",
            text: "Replication: a record of which a part is missing is whole.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/gathering.rs",
                "self.is_open && self.missing == 0",
                "self.is_open && (self.missing == 0 || broken!(PublishesIncomplete) && self.missing == 1)",
            )],
        },
        Planted {
            name: "MixesRecords",
            text: "Replication: a part of another record is put into the one that is open.",
            shows_in: IN_NETWORKS,
            edits: &[or("replication/gathering.rs", "arriving.record == *record")],
        },
        Planted {
            name: "SaysOtherIncarnation",
            text: "Replication: a record has another incarnation than at its origin.",
            shows_in: IN_NETWORKS,
            edits: &[instead("replication/gathering.rs", "part.incarnation", "1")],
        },
        Planted {
            name: "CutsElsewhere",
            text: "Replication: a part has the bytes of another place of its record.",
            shows_in: IN_NETWORKS,
            edits: &[instead(
                "replication/outgoing.rs",
                "&record.body()[offset..end]",
                "&record.body()[offset / 2..end - offset.div_ceil(2)]",
            )],
        },
        Planted {
            name: "TakesRecordsBack",
            text: "Replication: a record that is older than the newest makes its stream anew.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/incoming.rs",
                "if is_behind || !self.is_anew(life, record.sequence, next) {",
                "if is_behind || !broken!(TakesRecordsBack) && !self.is_anew(life, record.sequence, next) {",
            )],
        },
        Planted {
            name: "CountsOneThatCame",
            text: "Replication: of records that came whole only the first is counted.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/incoming/ending.rs",
                "counts.records.add(1);",
                "counts.records.add(u64::from(counts.records.get() == 0 || !broken!(CountsOneThatCame)));",
            )],
        },
        Planted {
            name: "SaysSampled",
            text: "Replication: a record more is said to be left out on purpose before each.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/incoming/ending.rs",
                "writer.finish(record.sequence, sampled.into())",
                "writer.finish(record.sequence, u64::from(sampled) + u64::from(broken!(SaysSampled)))",
            )],
        },
        Planted {
            name: "CountsRecordsTwice",
            text: "Replication: a record of two parts or more is counted as sent with each.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/outgoing.rs",
                "        if end == len {",
                r"        if broken!(CountsRecordsTwice) && end < len {
            destination.counts.records.add(1);
        }
        if end == len {",
            )],
        },
        Planted {
            name: "ForgetsOverwritten",
            text: "Replication: a record that was overwritten on its way is not counted.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/destination.rs",
                "        self.counts.lost.add(cause, 1);
    }

    fn again_of",
                r"        self.counts.lost.add(cause, if broken!(ForgetsOverwritten) { 0 } else { 1 });
    }

    fn again_of",
            )],
        },
        Planted {
            name: "AsksForEver",
            text: "Replication: a record is asked for at once and again, however often it was.",
            shows_in: IN_NETWORKS,
            edits: &[
                or("replication/gathering.rs", "(self.is_due || is_quiet"),
                and_not("replication/gathering.rs", "self.rounds >= ROUNDS_MAX"),
            ],
        },
        Planted {
            name: "RepeatsForEver",
            text: "Replication: what is asked for at once and again leaves however often it did.",
            shows_in: IN_NETWORKS,
            edits: &[
                edit(
                    "replication/gathering.rs",
                    "let is_quiet = now_ns",
                    "let is_quiet = broken!(RepeatsForEver) || now_ns",
                ),
                edit(
                    "replication/again.rs",
                    "*word & bit == 0 && self.budget > 0",
                    "*word & bit == 0 && (self.budget > 0 || broken!(RepeatsForEver))",
                ),
                edit("replication/again.rs", "self.budget - 1", "self.budget - usize::from(!broken!(RepeatsForEver))"),
            ],
        },
        Planted {
            name: "PartsUnpaced",
            text: "Outbound: parts of replicas leave faster than they may.",
            shows_in: IN_NETWORKS,
            edits: &[or("outbound/carry.rs", "if self.in_slots")],
        },
        Planted {
            name: "DescribesOnce",
            text: "Replication: a description that was lost is not sent again.",
            shows_in: IN_NETWORKS,
            edits: &[edit(
                "replication/outgoing.rs",
                "destination.describe_ns = now_ns + self.describe_every_ns;",
                r"let every_ns = self.describe_every_ns;
        destination.describe_ns = if broken!(DescribesOnce) { u64::MAX } else { now_ns + every_ns };",
            )],
        },
    ],
};
