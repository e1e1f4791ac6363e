//! What client and server beyond the LAN could do wrong.

use super::planted::{Group, Planted};
use rohrpost_planted::{and_not, before, edit, instead, left_out, or};

pub(crate) const SESSION: Group = Group {
    name: "SESSION",
    text: "Mistakes of sessions beyond the LAN.",
    mistakes: &[
        Planted {
            name: "ForgetsPieces",
            text: "Session: the beginning of a frame that comes in pieces is lost.",
            shows_in: "session::tests::ends::frames_that_come_byte_by_byte_are_whole",
            edits: &[edit(
                "session/splitter.rs",
                r"return Ok(None);
        }",
                r"return Ok(None);
        }
        if broken!(ForgetsPieces) {
            self.partial.clear();
        }",
            )],
        },
        Planted {
            name: "TakesTwice",
            text: "Session: a name that another client hosts is given away.",
            shows_in: "session::tests::ends::a_name_that_is_hosted_is_refused_naming_the_holder_until_that_one_goes",
            edits: &[edit(
                "session/table.rs",
                "self.in_the_way(client, range)",
                "self.in_the_way(client, range).filter(|_| !broken!(TakesTwice))",
            )],
        },
        Planted {
            name: "TakesInside",
            text: "Session: a narrower range inside another client's range is given away.",
            shows_in: "session::tests::shares::of_what_one_client_hosts_no_other_gets_a_part",
            edits: &[edit(
                "session/table.rs",
                "let objection = if held.holds(range)",
                r"if broken!(TakesInside) && held != *range && held.holds(range) {
                    continue;
                }
                let objection = if held.holds(range)",
            )],
        },
        Planted {
            name: "GivesAwayOwn",
            text: "Session: names that the file gives the nodes of the own system are given to any client.",
            shows_in: "session::tests::shares::what_the_file_gives_a_node_no_other_client_gets_where_nobody_shows_a_certificate",
            edits: &[or("session/server/rights.rs", "let is_free = |not: &Names| !not.meet(range)")],
        },
        Planted {
            name: "GoesThroughAll",
            text: "Session: a registration goes through the ranges of all clients.",
            shows_in: "session::tests::registering::when_eight_times_as_many_clients_come_at_once_the_server_works_about_eight_times_as_long",
            edits: &[edit(
                "session/table.rs",
                r"self.remove(client);
        for range in &wanted {",
                r"self.remove(client);
        if broken!(GoesThroughAll) {
            self.ranges = self.ranges.iter().map(|(first, hosted)| (*first, *hosted)).collect();
        }
        for range in &wanted {",
            )],
        },
        Planted {
            name: "FillsTable",
            text: "Session: a principal may have as many ranges as there is room for.",
            shows_in: "session::tests::shares::one_certificate_does_not_fill_the_table_however_often_it_connects",
            edits: &[edit(
                "session/server/registering.rs",
                "let room = (RANGES_SHARE + before).saturating_sub(used);",
                r"let fills = broken!(FillsTable);
        let room = if fills { crate::session::table::ENTRIES_MAX } else { (RANGES_SHARE + before).saturating_sub(used) };",
            )],
        },
        Planted {
            name: "ReplacesOthers",
            text: "Session: a client takes the place of any that says the same incarnation.",
            shows_in: "session::tests::shares::nobody_takes_the_place_of_a_client_of_another_principal",
            edits: &[before(
                "session/server/places.rs",
                "let id = self.principals.id_of(owner)?;",
                "let mut all = self.incarnations.iter(); return all.find(|((_, its), _)| *its == incarnation).map(|(_, client)| *client);",
            )],
        },
        Planted {
            name: "CrowdsOut",
            text: "Session: of too many connections, those of the principal with most do not give way.",
            shows_in: "session::tests::shares::one_address_does_not_push_others_out_before_their_hello",
            edits: &[
                before(
                    "session/server/places.rs",
                    "let owner = if handshakes.count_of(address) == most { address } else { largest };",
                    "let handshake = |(_, member): &(ClientIndex, &Member)| member.state == MemberState::Handshake; return self.present().filter(handshake).min_by_key(|(_, member)| member.began_ns).map(|(index, _)| index);",
                ),
                and_not("session/server/places.rs", "newest.filter(|_| most >= own + 2"),
            ],
        },
        Planted {
            name: "SharesQueue",
            text: "Session: packages of one principal give way to more important ones of another.",
            shows_in: "session::tests::shares::an_urgent_flood_of_a_line_leaves_others_their_share",
            edits: &[instead("queue/shares.rs", "share.sender", "0")],
        },
        Planted {
            name: "IgnoresShares",
            text: "Session: the most important leaves first, however much of it one principal sends.",
            shows_in: "session::tests::shares::an_urgent_flood_of_a_line_leaves_others_their_share",
            edits: &[edit(
                "queue/shares.rs",
                "let shares = self.shares.as_ref();",
                "let shares = self.shares.as_ref().filter(|_| !broken!(IgnoresShares));",
            )],
        },
        Planted {
            name: "SendsCutAgain",
            text: "Session: bytes made ready for a broken connection leave by the next one.",
            shows_in: "session::tests::strain::what_was_ready_for_a_connection_that_broke_is_gone_with_it",
            edits: &[edit(
                "session/outgoing.rs",
                r"pub(super) fn cut(&mut self) {
        self.ready.clear();",
                r"pub(super) fn cut(&mut self) {
        if !broken!(SendsCutAgain) {
            self.ready.clear();
        }",
            )],
        },
        Planted {
            name: "DeliversOld",
            text: "Session: a package that was under way too long is delivered.",
            shows_in: "session::tests::ends::what_the_streams_held_for_too_long_is_not_delivered",
            edits: &[and_not("session/client/incoming.rs", "Ok(()) if oldest_ns > AGE_MAX_NS")],
        },
        Planted {
            name: "TrustsTheWay",
            text: "Session: half of the round trip is no part of a time's bound.",
            shows_in: "session::estimate::tests::the_shortest_exchange_counts_until_it_is_old",
            edits: &[instead("session/estimate.rs", "self.ways_ns.div_ceil(2)", "0")],
        },
        Planted {
            name: "KeepsHops",
            text: "Session: a package that is handed on has no more hops than before.",
            shows_in: "session::tests::ends::a_package_that_goes_round_is_stopped",
            edits: &[instead("session/server/carry.rs", "carried.hops.saturating_add(1)", "carried.hops")],
        },
        Planted {
            name: "TakesForeignNames",
            text: "Session: a client may send in the names of others.",
            shows_in: "session::tests::ends::names_of_others_are_sent_by_nobody",
            edits: &[and_not("session/server/carry.rs", "let objection = if !is_own")],
        },
        Planted {
            name: "HandsBack",
            text: "Session: a package that a client cannot deliver comes back to it.",
            shows_in: "session::tests::ends::packages_go_to_the_host_of_the_name_and_never_back",
            edits: &[or("session/server/carry.rs", "let to = self.host_of(carried.head.to).filter(|to| *to != from")],
        },
        Planted {
            name: "ToOwnTwice",
            text: "Session: a client that reaches its own system gets back what it sends to all systems.",
            shows_in: "session::tests::a_client_that_stands_still_changes_nothing_for_the_others",
            edits: &[and_not(
                "session/server/carry.rs",
                "let reaches_itself = client == from || system == own && reaches_own",
            )],
        },
        Planted {
            name: "KeepsNames",
            text: "Session: a client that has gone still hosts its names.",
            shows_in: "session::tests::sessions_keep_their_promises_whatever_goes_wrong",
            edits: &[and_not("session/server/look.rs", "if ranges > 0")],
        },
        Planted {
            name: "ForgetsGone",
            text: "Session: packages that waited for a client that has gone are not counted.",
            shows_in: "session::tests::sessions_keep_their_promises_whatever_goes_wrong",
            edits: &[left_out(
                "session/server/look.rs",
                "self.with_ledger(now_ns, client, host, |outgoing, ledger| outgoing.give_up(Cause::Gone, ledger));",
            )],
        },
        Planted {
            name: "GreetsForEver",
            text: "Session: a connection without a hello stays.",
            shows_in: "session::tests::ends::a_client_without_a_hello_is_closed_and_keeps_no_other_out",
            edits: &[edit(
                "session/server/look.rs",
                "MemberState::Handshake => {",
                r"MemberState::Handshake if broken!(GreetsForEver) => None,
        MemberState::Handshake => {",
            )],
        },
        Planted {
            name: "WaitsForSilent",
            text: "Session: a silent end stays connected.",
            shows_in: "session::tests::ends::a_silent_end_is_gone",
            edits: &[
                edit(
                    "session/client/mod.rs",
                    "_ => is_silent || is_stalled,",
                    "_ => (is_silent && !broken!(WaitsForSilent)) || is_stalled,",
                ),
                and_not("session/server/look.rs", "MemberState::Member if since(member.heard_ns) > silent_after_ns"),
            ],
        },
        Planted {
            name: "TakesOtherCommon",
            text: "Session: another digest of what must be equal everywhere is accepted.",
            shows_in: "session::tests::ends::a_client_with_another_digest_takes_no_part_and_is_told_both",
            edits: &[
                and_not("session/client/incoming.rs", "if yours != ours"),
                and_not("session/server/intake.rs", "if hello.common != settings.common"),
            ],
        },
        Planted {
            name: "TakesOtherSystems",
            text: "Session: another digest of what must be equal inside a system is accepted.",
            shows_in: "session::tests::ends::a_client_with_another_digest_takes_no_part_and_is_told_both",
            edits: &[edit(
                "session/server/intake.rs",
                "let (holder, digest) = held.filter(|(_, digest)| *digest != hello.system_digest)?;",
                r"let is_other = |digest: u64| digest != hello.system_digest && !broken!(TakesOtherSystems);
        let (holder, digest) = held.filter(|(_, digest)| is_other(*digest))?;",
            )],
        },
        Planted {
            name: "RegistersOnce",
            text: "Session: a client that connects again does not register its names.",
            shows_in: "session::tests::shares::what_the_file_gives_a_node_no_other_client_gets_where_nobody_shows_a_certificate",
            edits: &[edit(
                "session/client/mod.rs",
                r"self.state = ClientState::Away { until_ns: now_ns + self.backoff.next_ns() };
        self.registration = Registration::Due(now_ns);",
                r"self.state = ClientState::Away { until_ns: now_ns + self.backoff.next_ns() };
        if !broken!(RegistersOnce) {
            self.registration = Registration::Due(now_ns);
        }",
            )],
        },
        Planted {
            name: "NeverBacksOff",
            text: "Session: a client tries again at once, however often it fails.",
            shows_in: "session::client::backoff::tests::waits_double_up_to_a_limit_and_differ_between_clients",
            edits: &[before(
                "session/client/backoff.rs",
                "let longest_ns = (FIRST_NS << self.failures).min(BACKOFF_MAX_NS);",
                "return FIRST_NS / 100;",
            )],
        },
        Planted {
            name: "RegistersAtOnce",
            text: "Session: every registration is processed, however many one client sends.",
            shows_in: "session::tests::strain::of_many_registrations_of_one_client_the_first_and_the_last_are_looked_at",
            edits: &[or("session/server/registering.rs", "if is_its_turn")],
        },
        Planted {
            name: "NeverReplaces",
            text: "Session: packages of which only the newest counts all wait.",
            shows_in: "session::tests::newest::of_data_of_which_only_the_newest_counts_that_goes_in_the_place_of_the_first",
            edits: &[and_not("queue/mod.rs", "let hints = self.hints.as_ref().filter(|_| counts_newest(&newer.head)")],
        },
        Planted {
            name: "ReplacesAllData",
            text: "Session: of all data only the newest counts.",
            shows_in: "session::tests::newest::nothing_else_is_replaced",
            edits: &[edit(
                "queue/mod.rs",
                "is_data && head.options.has(Options::NEWEST)",
                "is_data && (head.options.has(Options::NEWEST) || broken!(ReplacesAllData))",
            )],
        },
        Planted {
            name: "ForgetsReplaced",
            text: "Session: a replaced package is not counted.",
            shows_in: "session::tests::newest::of_data_of_which_only_the_newest_counts_that_goes_in_the_place_of_the_first",
            edits: &[and_not("session/outgoing.rs", "if is_taken")],
        },
        Planted {
            name: "LosesItsPlace",
            text: "Session: a package that replaces an older one waits behind all others.",
            shows_in: "session::tests::newest::of_data_of_which_only_the_newest_counts_that_goes_in_the_place_of_the_first",
            edits: &[instead(
                "session/outgoing.rs",
                "queue.replace(older, newer, body, gives_way(newer.sender, fates))",
                r"queue.remove(older);
        queue.push(newer, body, gives_way(newer.sender, fates))",
            )],
        },
        Planted {
            name: "LooksAtFirst",
            text: "Session: a stale package behind a fresh one is not found.",
            shows_in: "session::tests::newest::what_stands_behind_a_fresh_one_is_given_up_in_time",
            edits: &[or("session/outgoing.rs", "} else if !counts_newest(head)")],
        },
        Planted {
            name: "AsksLast",
            text: "Session: a request for the time waits behind packages that have not begun to leave.",
            shows_in: "session::client::asking::tests::a_server_that_was_not_asked_yet_is_not_silent_as_long_as_the_stream_moves",
            edits: &[
                edit(
                    "session/client/asking.rs",
                    r"(None, Some(_)) => moved_ns,
            (None, None) => heard_ns,",
                    r"(None, Some(_)) if !broken!(AsksLast) => moved_ns,
            (None, _) => heard_ns,",
                ),
                instead("session/outgoing.rs", "self.next_frame().max(self.hurried)", "self.ready.len()"),
            ],
        },
    ],
};
