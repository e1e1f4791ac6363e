//! What a router could do wrong in time slots.

use super::planted::{Group, Planted};
use rohrpost_planted::{and_not, before, edit, instead, or};

pub(crate) const IN_SLOT: Group = Group {
    name: "IN_SLOT",
    text: "Mistakes of what leaves in a slot; they do not show where packages leave at once.",
    mistakes: &[
        Planted {
            name: "OvertakesInSlot",
            text: "Outbound: in a slot a package that fits leaves before a more important one that does not.",
            shows_in: "outbound::tests::slot::a_package_that_does_not_fit_is_passed_by_no_less_important_one",
            edits: &[and_not("outbound/datagram.rs", "if self.in_slots")],
        },
        Planted {
            name: "OverrunsSlot",
            text: "Outbound: more leaves than the slot has room for.",
            shows_in: "outbound::tests::slot::a_datagram_leaves_only_if_it_fits",
            edits: &[instead("outbound/slot.rs", "room_bytes.min(self.datagram_bytes)", "self.datagram_bytes")],
        },
        Planted {
            name: "AnyCompany",
            text: "Outbound: a datagram in a slot also carries packages that are less important than one for another peer.",
            shows_in: "outbound::tests::slot::company_is_no_less_important_than_what_waits_for_others",
            edits: &[before(
                "outbound/slot.rs",
                "let others = self.queue.first_level_besides(peer).unwrap_or(LEVELS as u8);",
                "return LEVELS as u8;",
            )],
        },
        Planted {
            name: "ForgetsMailbox",
            text: "Outbound: a datagram in a slot also carries packages that are less important than one in the mailbox.",
            shows_in: "outbound::tests::slot::company_is_no_less_important_than_what_waits_in_the_mailbox",
            edits: &[edit(
                "outbound/slot.rs",
                "let behind = behind.map_or(LEVELS as u8, |first| self.level(first));",
                "let behind = behind.filter(|_| !broken!(ForgetsMailbox)).map_or(LEVELS as u8, |first| self.level(first));",
            )],
        },
        Planted {
            name: "OverrunsWithPart",
            text: "Driver: a part of a replica leaves although the window is too short for it.",
            shows_in: "driver::tests::parts::records_cross_in_slots_behind_packages_and_inside_of_windows",
            edits: &[and_not("driver/parts.rs", "if !tx_window.fits(now_ns, bytes)")],
        },
        Planted {
            name: "PartsFirst",
            text: "Driver: parts of replicas leave before packages.",
            shows_in: "driver::tests::parts::records_cross_in_slots_behind_packages_and_inside_of_windows",
            edits: &[edit(
                "driver/slots.rs",
                "let goes_on = self.send_packages(on, tx_window);",
                r"while broken!(PartsFirst) && self.parts.send_next(on, tx_window) {}
        let goes_on = self.send_packages(on, tx_window);",
            )],
        },
    ],
};

pub(crate) const SLOTS: Group = Group {
    name: "SLOTS",
    text: "Mistakes of time slots.",
    mistakes: &[
        Planted {
            name: "NoLateGate",
            text: "Time slots: no wake-up is too late.",
            shows_in: "tdma::tests::single::what_is_late_is_not_sent",
            edits: &[and_not("tdma/scheduler.rs", "if is_slot && now_ns > planned.begin_ns.saturating_add(GATE_NS)")],
        },
        Planted {
            name: "SendsWhenUnsure",
            text: "Time slots: a node sends however far off its clock may be.",
            shows_in: "tdma::tests::single::silence_begins_right_above_the_allowance",
            edits: &[
                or("tdma/scheduler.rs", "let own = clock.estimate().filter(|own| is_sure(own)"),
                and_not("tdma/scheduler.rs", "if bound_ns > allowance_ns"),
            ],
        },
        Planted {
            name: "IgnoresGuard",
            text: "Time slots: a window ends where its guard does.",
            shows_in: "tdma::tests::arithmetic::windows_end_where_their_guard_begins",
            edits: &[edit(
                "tdma/table.rs",
                "let guard_ns = self.guard_ns;",
                "let guard_ns = if broken!(IgnoresGuard) { 0 } else { self.guard_ns };",
            )],
        },
        Planted {
            name: "LeadTooLong",
            text: "Time slots: calls are made earlier than frames need to reach the wire.",
            shows_in: "tdma::tests::single::no_frame_starts_before_its_slot",
            edits: &[instead(
                "tdma/lead.rs",
                "self.median_ns.min(self.least[0]).min(self.least[1])",
                "2 * self.median_ns",
            )],
        },
        Planted {
            name: "ForgetsHandedOver",
            text: "Time slots: bytes already handed over do not count for what still fits.",
            shows_in: "tdma::tests::single::what_was_handed_over_counts",
            edits: &[instead("tdma/tx_window.rs", "self.free_ns.max(at_once_ns)", "at_once_ns")],
        },
        Planted {
            name: "ReplacementCalibrates",
            text: "Time slots: a replacement's Sync is taken for the master's.",
            shows_in: "tdma::tests::single::a_replacement_is_a_sign_of_life_and_nothing_else",
            edits: &[before(
                "time/clock/slots.rs",
                "Ok(())",
                "slots.coarse.add(sync.epoch, sync.sent_ns, received.ns, 0);",
            )],
        },
        Planted {
            name: "ReplacesHeard",
            text: "Time slots: a backup master sends although the master's Sync came.",
            shows_in: "tdma::tests::scenes::a_master_dies_and_no_slot_is_lost",
            edits: &[edit(
                "time/clock/slots.rs",
                "ElectionState::Slave(master) => self.may_synchronise() && is_missing(&master),",
                "ElectionState::Slave(master) => self.may_synchronise() && (is_missing(&master) || broken!(ReplacesHeard)),",
            )],
        },
        Planted {
            name: "SyncInForeignWindow",
            text: "Time slots: a master sends Syncs in its slots.",
            shows_in: "tdma::tests::scenes::a_master_dies_and_no_slot_is_lost",
            edits: &[edit(
                "time/clock/slots.rs",
                "Allowed::Slot => self.take_draft(|draft| !(replies_wait && is_reply(draft))),",
                r"Allowed::Slot if broken!(SyncInForeignWindow) => {
                let cycle = self.line.at(now_ns).ns / self.interval_ns;
                let sync = self.next_sync(now_ns, cycle, cycle * self.interval_ns);
                sync.or_else(|| self.take_draft(|_| true))
            }
            Allowed::Slot => self.take_draft(|draft| !(replies_wait && is_reply(draft))),",
            )],
        },
        Planted {
            name: "KeepsOwnTime",
            text: "Time slots: a node that yields to another master keeps its own time.",
            shows_in: "tdma::tests::single::a_node_that_turns_while_the_first_master_lives_is_not_sure",
            edits: &[edit(
                "time/clock/slots.rs",
                "slots.unsure |= contested || (!is_measured && is_other);",
                "slots.unsure |= (contested || (!is_measured && is_other)) && !broken!(KeepsOwnTime);",
            )],
        },
    ],
};

pub(crate) const JOINING: Group = Group {
    name: "JOINING",
    text: "Mistakes of nodes that begin or join a time.",
    mistakes: &[
        Planted {
            name: "BeginsAtOnce",
            text: "Time slots: a node that starts begins a time without listening first.",
            shows_in: "tdma::tests::overheard::a_node_that_hears_unverified_frames_begins_no_time_for_a_while",
            edits: &[edit(
                "time/election.rs",
                "let (since_ns, patience_ns, last) = match self.state {",
                r"if broken!(BeginsAtOnce) && (origin, self.state) == (Origin::New, ElectionState::Listening) {
            return Some(now_ns);
        }
        let (since_ns, patience_ns, last) = match self.state {",
            )],
        },
        Planted {
            name: "BeginsForEver",
            text: "Time slots: a node that begins a time never sends anything but Syncs.",
            shows_in: "tdma::tests::tables::a_node_with_an_edited_file_beside_others_sends_nothing",
            edits: &[edit(
                "time/clock/slots.rs",
                "slots.beginning = slots.beginning.saturating_sub(1);",
                "slots.beginning = slots.beginning.saturating_sub(u8::from(!broken!(BeginsForEver)));",
            )],
        },
        Planted {
            name: "TrustsItself",
            text: "Time slots: a node's own time has no bound.",
            shows_in: "tdma::tests::single::silence_begins_right_above_the_allowance",
            edits: &[before(
                "time/clock/slots.rs",
                "Some(TimeEstimate::new(TimeRecord { error_ns, ..record }))",
                "return Some(TimeEstimate::new(TimeRecord { error_ns: 0, drift_ns_s: 0, ..record }));",
            )],
        },
        Planted {
            name: "AsksTooSoon",
            text: "Time slots: a node that knows the time by overhearing asks before its slot begins.",
            shows_in: "tdma::tests::single::a_node_listens_then_asks_then_sends",
            edits: &[edit(
                "tdma/scheduler.rs",
                "let begin_ns = estimate.first_ns(window.begin_ns)?;",
                r"let is_soon = broken!(AsksTooSoon) && carries == Carries::Time;
        let soon_ns = if is_soon { self.table.allowance_ns() } else { 0 };
        let begin_ns = estimate.first_ns(window.begin_ns - soon_ns)?;",
            )],
        },
        Planted {
            name: "NeverBeginsEpoch",
            text: "Time: a master ignores nodes that are too far off to follow it.",
            shows_in: "tdma::tests::tables::a_node_that_does_not_hear_that_it_must_yield_silences_the_others",
            edits: &[and_not("time/clock/master.rs", "if request.far")],
        },
    ],
};

pub(crate) const UNPROVEN: Group = Group {
    name: "UNPROVEN",
    text: "Mistakes of joining a network with time slots where datagrams are sealed.",
    mistakes: &[
        Planted {
            name: "IgnoresUnproven",
            text: "Time slots, sealed: a node begins a time whatever it hears of unverified peers.",
            shows_in: "tdma::tests::overheard::a_node_that_hears_unverified_frames_begins_no_time_for_a_while",
            edits: &[
                before(
                    "time/unverified.rs",
                    "self.span_ns.map_or(0, |(first_ns, last_ns)| last_ns.min(self.ends_ns(first_ns)))",
                    "return 0;",
                ),
                and_not(
                    "time/unverified.rs",
                    "self.span_ns.is_none_or(|(first_ns, _)| now_ns < self.ends_ns(first_ns))",
                ),
            ],
        },
        Planted {
            name: "WaitsForEver",
            text: "Time slots, sealed: it never begins a time while it hears any.",
            shows_in: "tdma::tests::overheard::a_new_master_steps_back_until_patience_is_over",
            edits: &[instead("time/unverified.rs", "first_ns.saturating_add(self.patience_ns)", "u64::MAX")],
        },
        Planted {
            name: "TakesUnproven",
            text: "Time slots, sealed: messages of unverified peers are taken as if they were verified.",
            shows_in: "tdma::tests::overheard::a_hello_leaves_in_one_of_four_cycles_and_nothing_else",
            edits: &[before(
                "time/clock/overhearing.rs",
                "let is_other = head.digest != self.settings.digest;",
                "return self.handle(now_ns, received, head, rest);",
            )],
        },
        Planted {
            name: "TellsUnproven",
            text: "Time slots, sealed: more than hellos leave by the time of unverified peers.",
            shows_in: "tdma::tests::overheard::a_hello_leaves_in_one_of_four_cycles_and_nothing_else",
            edits: &[and_not("tdma/tx_window.rs", "_ if self.carries == Carries::Hello")],
        },
        Planted {
            name: "AsksWithoutPause",
            text: "Time slots, sealed: hellos leave in each slot by the time of unverified peers.",
            shows_in: "tdma::tests::overheard::a_hello_leaves_in_one_of_four_cycles_and_nothing_else",
            edits: &[edit(
                "tdma/scheduler.rs",
                "self.hello_from_ns = tx_window.begin_ns.saturating_add(pause_ns);",
                r"self.hello_from_ns =
                tx_window.begin_ns.saturating_add(if broken!(AsksWithoutPause) { 0 } else { pause_ns });",
            )],
        },
    ],
};

pub(crate) const UNSTEADY: Group = Group {
    name: "UNSTEADY",
    text: "Mistakes where a local clock is not steady.",
    mistakes: &[
        Planted {
            name: "SleepsUnnoticed",
            text: "Time: a suspended computer goes unnoticed.",
            shows_in: "time::steadiness::tests::a_computer_that_slept_is_not_believed_and_no_clock_of_it_is_called_slewed",
            edits: &[edit(
                "time/steadiness.rs",
                "Some(Unsteady::Slept { slept_ns })",
                "(!broken!(SleepsUnnoticed)).then_some(Unsteady::Slept { slept_ns })",
            )],
        },
        Planted {
            name: "SlewsUnnoticed",
            text: "Time: a clock that another process slews goes unnoticed.",
            shows_in: "time::steadiness::tests::a_clock_that_is_slewed_for_long_is_unsteady_all_the_time_and_believed_soon_after",
            edits: &[before("time/steadiness.rs", "let began = *self.began.get_or_insert(now);", "return None;")],
        },
    ],
};

pub(crate) const TABLES: Group = Group {
    name: "TABLES",
    text: "Mistakes of time slots beside nodes of another configuration.",
    mistakes: &[
        Planted {
            name: "DeafToOtherTables",
            text: "Time slots: messages of nodes with another configuration are ignored.",
            shows_in: "tdma::tests::tables::a_node_with_an_edited_file_beside_others_sends_nothing",
            edits: &[
                or(
                    "time/clock/other_tables.rs",
                    r"// Without slots two times do not disturb each other.
        if self.slots.is_none()",
                ),
                or(
                    "time/clock/other_tables.rs",
                    r"pub(super) fn refused_by(&mut self, packages: &Stats, now_ns: u64, local_ns: u64) {
        if self.slots.is_none()",
                ),
                edit(
                    "time/clock/overhearing.rs",
                    "if self.is_parted(now_ns) {",
                    "if self.is_parted(now_ns) || (is_other && broken!(DeafToOtherTables)) {",
                ),
            ],
        },
        Planted {
            name: "NeverYieldsToOthers",
            text: "Time slots: the node with the lesser claim goes on.",
            shows_in: "tdma::tests::tables::of_two_tables_that_meet_one_goes_on",
            edits: &[edit(
                "time/others.rs",
                "if theirs > own || local_ns.saturating_sub(other.since_ns) > grace_ns {",
                "if (theirs > own && !broken!(NeverYieldsToOthers)) || local_ns.saturating_sub(other.since_ns) > grace_ns {",
            )],
        },
    ],
};
