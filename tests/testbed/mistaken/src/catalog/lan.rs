//! What routers of the LAN could do wrong.

use super::{Group, Planted, edit};

pub(crate) const CARRYING: Group = Group {
    name: "CARRYING",
    text: "Mistakes of the cores that carry packages.",
    mistakes: &[
        Planted {
            name: "SkipsCheck",
            text: "Frame: the check is not compared.",
            shows_in: None,
            edits: &[edit(
                "frame/mod.rs",
                "if b[CHECK] != check(b, &[rest]).to_le_bytes() {",
                "if b[CHECK] != check(b, &[rest]).to_le_bytes() && !broken!(SkipsCheck) {",
            )],
        },
        Planted {
            name: "IgnoresLevels",
            text: "Queue: the package that has waited longest leaves first, whatever its level.",
            shows_in: None,
            edits: &[edit(
                "queue/mod.rs",
                "let level = bits(self.levels.into()).find(|level| self.busy[*level] & peers != 0)?;",
                r"if broken!(IgnoresLevels) {
            let firsts = self.peers.iter().flatten().filter_map(List::first);
            return firsts.min_by_key(|place| self.entries[*place as usize].ticket).map(Place);
        }
        let level = bits(self.levels.into()).find(|level| self.busy[*level] & peers != 0)?;",
            )],
        },
        Planted {
            name: "TakesNewest",
            text: "Queue: the newest package of a level leaves first.",
            shows_in: None,
            edits: &[edit(
                "queue/mod.rs",
                "list.first().map(Place)",
                "if broken!(TakesNewest) { list.last() } else { list.first() }.map(Place)",
            )],
        },
        Planted {
            name: "SharesQuota",
            text: "Queue: a sender may use up the memory of all.",
            shows_in: None,
            edits: &[edit(
                "queue/mod.rs",
                "let quota = self.quota_blocks;",
                r"let quota = if broken!(SharesQuota) {
            self.entries.len() as u32 - self.used_blocks + own.used
        } else {
            self.quota_blocks
        };",
            )],
        },
        Planted {
            name: "DisplacesOldest",
            text: "Queue: the oldest package gives way in place of the newest.",
            shows_in: None,
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
            shows_in: None,
            edits: &[edit(
                "queue/mod.rs",
                "gone(&waiting, beginning);",
                r"if !broken!(ForgetsDisplaced) {
            gone(&waiting, beginning);
        }",
            )],
        },
        Planted {
            name: "Unpaced",
            text: "Outbound: the bytes a second have no limit.",
            shows_in: None,
            edits: &[edit(
                "outbound/pace.rs",
                "if from_ns <= now_ns { Ok(()) } else { Err(from_ns) }",
                "if from_ns <= now_ns || broken!(Unpaced) { Ok(()) } else { Err(from_ns) }",
            )],
        },
        Planted {
            name: "NeverInAdvance",
            text: "Outbound: a package that is more important than the last one waits for the pace as well.",
            shows_in: None,
            edits: &[edit(
                "outbound/pace.rs",
                "let hurries = level < self.level;",
                "let hurries = level < self.level && !broken!(NeverInAdvance);",
            )],
        },
        Planted {
            name: "Hurries",
            text: "Outbound: a package keeps a priority above that of its sender or its request.",
            shows_in: None,
            edits: &[edit(
                "outbound/mod.rs",
                r"pub fn accept(&mut self, now_ns: u64, package: &Package<'_>, alone: bool, report: &mut impl Report) -> Accepted {
        let head = capped(&package.head);",
                r"pub fn accept(&mut self, now_ns: u64, package: &Package<'_>, alone: bool, report: &mut impl Report) -> Accepted {
        let head = if broken!(Hurries) { package.head } else { capped(&package.head) };",
            )],
        },
        Planted {
            name: "SendsStale",
            text: "Outbound: a package that waited too long leaves nevertheless.",
            shows_in: None,
            edits: &[edit(
                "outbound/mod.rs",
                "now_ns.saturating_sub(published_ns) > WAIT_MAX_NS",
                "now_ns.saturating_sub(published_ns) > WAIT_MAX_NS && !broken!(SendsStale)",
            )],
        },
        Planted {
            name: "NeverSilent",
            text: "Link: no peer is ever silent.",
            shows_in: None,
            edits: &[edit(
                "link.rs",
                "if heard_ns.max(started_ns).saturating_add(SILENT_AFTER_NS) <= now_ns {",
                "if heard_ns.max(started_ns).saturating_add(SILENT_AFTER_NS) <= now_ns && !broken!(NeverSilent) {",
            )],
        },
        Planted {
            name: "NeverUnheard",
            text: "Link: no peer is ever deaf to this node.",
            shows_in: None,
            edits: &[edit(
                "link.rs",
                "if is_unheard { State::Unheard } else { State::Alive }",
                "if is_unheard && !broken!(NeverUnheard) { State::Unheard } else { State::Alive }",
            )],
        },
        Planted {
            name: "TakesCopies",
            text: "Inbound: duplicates are taken.",
            shows_in: None,
            edits: &[edit(
                "inbound/window.rs",
                "if self.is_copy(sequence) {",
                "if self.is_copy(sequence) && !broken!(TakesCopies) {",
            )],
        },
        Planted {
            name: "CountsNoGaps",
            text: "Inbound: missing datagrams are not counted.",
            shows_in: None,
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
            shows_in: None,
            edits: &[
                edit(
                    "fragment/mod.rs",
                    "older.is_late |= flow(&older.head) == flow(newer);",
                    "older.is_late |= flow(&older.head) == flow(newer) && !broken!(TakesLate);",
                ),
                edit(
                    "inbound/order.rs",
                    "Some((last, _)) => mark <= *last,",
                    "Some((last, _)) => mark <= *last && !broken!(TakesLate),",
                ),
            ],
        },
        Planted {
            name: "ForgetsFloor",
            text: "Inbound: a flow without a place in the table is not ordered.",
            shows_in: None,
            edits: &[edit(
                "inbound/order.rs",
                "None => mark <= group.floor,",
                "None => mark <= group.floor && !broken!(ForgetsFloor),",
            )],
        },
        Planted {
            name: "TakesOldIncarnations",
            text: "Inbound: datagrams of earlier incarnations are taken.",
            shows_in: None,
            edits: &[edit(
                "inbound/peer.rs",
                "let may_go_on = first.is_some() || (is_silent && goes_on);",
                "let may_go_on = first.is_some() || (is_silent && goes_on) || broken!(TakesOldIncarnations);",
            )],
        },
        Planted {
            name: "TakesOtherDigests",
            text: "Inbound: nodes of another configuration are not refused.",
            shows_in: None,
            edits: &[edit(
                "inbound/refusing.rs",
                "if head.digest != ours.digest {",
                "if head.digest != ours.digest && !broken!(TakesOtherDigests) {",
            )],
        },
        Planted {
            name: "TakesStale",
            text: "Inbound: a datagram that waited too long in the socket is delivered.",
            shows_in: None,
            edits: &[edit(
                "inbound/mod.rs",
                "let is_old = now_ns.saturating_sub(came.arrived_ns) > SOCKET_MAX_NS;",
                "let is_old = now_ns.saturating_sub(came.arrived_ns) > SOCKET_MAX_NS && !broken!(TakesStale);",
            )],
        },
        Planted {
            name: "MixesPackages",
            text: "Fragment: fragments of different packages of a flow are put together.",
            shows_in: None,
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
            shows_in: None,
            edits: &[edit(
                "fragment/mod.rs",
                "if !agrees || self.came[word] & bit != 0 {",
                "if !agrees || self.came[word] & bit != 0 && !broken!(CountsPartsTwice) {",
            )],
        },
        Planted {
            name: "KeepsParts",
            text: "Fragment: no package is given up for its age.",
            shows_in: None,
            edits: &[edit(
                "fragment/mod.rs",
                "if partial.is_used && now_ns.saturating_sub(partial.touched_ns) >= PATIENCE_NS {",
                "if partial.is_used && now_ns.saturating_sub(partial.touched_ns) >= PATIENCE_NS && !broken!(KeepsParts) {",
            )],
        },
        Planted {
            name: "Unbounded",
            text: "Fragment: as many packages are put together at a time as have begun.",
            shows_in: None,
            edits: &[edit(
                "fragment/mod.rs",
                "if self.partial.len() < PARTIAL_MAX {",
                "if self.partial.len() < PARTIAL_MAX || broken!(Unbounded) {",
            )],
        },
    ],
};

pub(crate) const ADMISSION: Group = Group {
    name: "ADMISSION",
    text: "Mistakes of admission.",
    mistakes: &[
        Planted {
            name: "AdmitsHurry",
            text: "Admission: a package keeps the priority that its sender wrote.",
            shows_in: None,
            edits: &[
                edit(
                    "inbound/mod.rs",
                    "let admitted = |head: &Head| capped(head);",
                    "let admitted = |head: &Head| if broken!(AdmitsHurry) { *head } else { capped(head) };",
                ),
                edit(
                    "session/client/incoming.rs",
                    "let head = capped(&carried.head);",
                    "let head = if broken!(AdmitsHurry) { carried.head } else { capped(&carried.head) };",
                ),
            ],
        },
        Planted {
            name: "AdmitsForeignNames",
            text: "Admission: any node may send in any name.",
            shows_in: None,
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
            shows_in: None,
            edits: &[
                edit(
                    "admission/mod.rs",
                    "if self.is_across_systems(way, head) {",
                    "if self.is_across_systems(way, head) && !broken!(AdmitsRoutersOwn) {",
                ),
                edit(
                    "admission/mod.rs",
                    "None => Err(Refused::RoutersOwn),",
                    r"None if broken!(AdmitsRoutersOwn) => Ok(()),
            None => Err(Refused::RoutersOwn),",
                ),
            ],
        },
        Planted {
            name: "AdmitsPackets",
            text: "Admission: any body is an IP packet of the node that it comes from.",
            shows_in: None,
            edits: &[edit(
                "admission/mod.rs",
                "Some(node) if !self.is_packet_of(node, body) => Err",
                "Some(node) if !self.is_packet_of(node, body) && !broken!(AdmitsPackets) => Err",
            )],
        },
    ],
};

pub(crate) const CROWDED: Group = Group {
    name: "CROWDED",
    text: "Mistakes that show with many flows and without reordering.",
    mistakes: &[Planted {
        name: "ForgetsBegun",
        text: "Inbound: a package in fragments is ordered by its flow's state when the last fragment comes.",
        shows_in: None,
        edits: &[edit(
            "inbound/order.rs",
            "let is_late = whole.is_late;",
            "let is_late = if broken!(ForgetsBegun) { self.is_late(&whole.head, position) } else { whole.is_late };",
        )],
    }],
};

pub(crate) const FORGED: Group = Group {
    name: "FORGED",
    text: "Mistakes that show where datagrams are forged.",
    mistakes: &[
        Planted {
            name: "BelievesIncarnations",
            text: "Inbound: a new incarnation of a peer is believed at its first datagram.",
            shows_in: None,
            edits: &[edit(
                "inbound/peer.rs",
                "let is_doubted = !is_vouched_for && was.is_none() && !is_first;",
                "let is_doubted = !is_vouched_for && was.is_none() && !is_first && !broken!(BelievesIncarnations);",
            )],
        },
        Planted {
            name: "BelievesJumps",
            text: "Inbound: a sequence number far ahead is believed at once.",
            shows_in: None,
            edits: &[edit(
                "inbound/peer.rs",
                "if !is_ahead && !is_behind {",
                "if !is_ahead && !is_behind || broken!(BelievesJumps) {",
            )],
        },
        Planted {
            name: "BelievesRefusals",
            text: "Inbound: one refusal parts this node from a peer that has just said that it hears it.",
            shows_in: None,
            edits: &[edit(
                "inbound/refusing.rs",
                "if heard_ns > 0 && heard_ns + SILENT_AFTER_NS > now_ns {",
                "if heard_ns > 0 && heard_ns + SILENT_AFTER_NS > now_ns && !broken!(BelievesRefusals) {",
            )],
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
            shows_in: None,
            edits: &[edit(
                "outbound/mod.rs",
                "self.reached & !self.full & self.hearing",
                "if broken!(WaitsForOne) && self.full != 0 { 0 } else { self.reached & !self.full & self.hearing }",
            )],
        },
        Planted {
            name: "OpensTwice",
            text: "Security: a datagram that was opened before is opened again.",
            shows_in: None,
            edits: &[
                edit(
                    "security/opening.rs",
                    "if heard.window.is_copy(head.sequence) {",
                    "if heard.window.is_copy(head.sequence) && !broken!(OpensTwice) {",
                ),
                edit(
                    "security/opening.rs",
                    "debug_assert!(arrival != Arrival::Copy);",
                    "debug_assert!(arrival != Arrival::Copy || broken!(OpensTwice));",
                ),
            ],
        },
        Planted {
            name: "BeginsUnproven",
            text: "Security: any sender of a hello is taken to be alive.",
            shows_in: None,
            edits: &[edit(
                "security/handshake.rs",
                "let proves = self.is_answer(now_ns, peer, hello.answer);",
                "let proves = self.is_answer(now_ns, peer, hello.answer) || broken!(BeginsUnproven);",
            )],
        },
        Planted {
            name: "BelievesUnopened",
            text: "Security: a datagram that cannot be opened is believed to come from a peer that is heard.",
            shows_in: None,
            edits: &[edit("inbound/refusing.rs", "if is_away {", "if is_away || broken!(BelievesUnopened) {")],
        },
    ],
};
