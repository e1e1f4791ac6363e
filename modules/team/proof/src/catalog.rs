//! The mistakes, each with the promise that it breaks, in the model that notices it. A proof that cannot fail proves
//! nothing. `broken!` asks whether its mistake is made.

use rohrpost_planted::{Catalog, Edit, Mistake, and_not, edit, instead, or};

pub(crate) const MISTAKES: &Catalog = &[GROUP, VIEW, COORDINATION];

/// Robots without records, of which one dies and comes back.
const fn group(name: &'static str, edits: &'static [Edit], says: &'static str) -> Mistake {
    Mistake { name, edits, test: "a_mistaken_group_keeps_its_promises", says }
}

/// Robots with records.
const fn view(name: &'static str, edits: &'static [Edit], says: &'static str) -> Mistake {
    Mistake { name, edits, test: "a_mistaken_view_keeps_its_promises", says }
}

const GROUP: &[Mistake] = &[
    group(
        "expired_counters_are_forgotten",
        &[edit(
            "group/mod.rs",
            "self.version = self.version.next();",
            "self.version = self.version.next();
        if broken!(expired_counters_are_forgotten) {
            let fresh: BTreeSet<RobotId> = self.fresh(now_ns).map(|(robot, _)| robot).collect();
            self.members.retain(|robot, _| fresh.contains(robot));
        }",
        )],
        "what a robot knows of another one does not go back",
    ),
    group(
        "old_counters_are_young_where_they_come",
        &[
            edit(
                "group/mod.rs",
                "now_ns.saturating_sub(entry.age_ns);",
                "if broken!(old_counters_are_young_where_they_come) { now_ns }
                else { now_ns.saturating_sub(entry.age_ns) };",
            ),
            instead("group/mod.rs", "member.sent_ns.min(sent_ns)", "member.sent_ns.max(sent_ns)"),
        ],
        "a dead robot is forgotten after its greatest age and two beats",
    ),
    group(
        "hops_are_not_counted",
        &[instead("group/mod.rs", "entry.hops + 1", "0")],
        "a robot names only robots that it hears",
    ),
    group(
        "an_incarnation_stays_below_one_that_is_heard",
        &[or("group/mod.rs", "if version <= self.version")],
        "leader and group are right two beats after the last fault",
    ),
    group(
        "a_robot_that_has_lost_its_store_is_a_duplicate",
        &[or("group/mod.rs", "if member.earlier.1 == EARLIER_MAX")],
        "a restarted robot is not taken for two",
    ),
];

const VIEW: &[Mistake] = &[
    view(
        "no_synchro_is_sent",
        &[and_not("team.rs", "(parts != 0")],
        "views are equal three beats after leader and group",
    ),
    view(
        "digests_are_of_live_records_only",
        &[
            edit(
                "view/mod.rs",
                "if *ledger == Ledger::default() {",
                "let is_live = |kept: &Kept| !(broken!(digests_are_of_live_records_only) && kept.record.is_ended());
    if *ledger == Ledger::default() || !ledger.records.values().any(is_live) {",
            ),
            edit(
                "view/mod.rs",
                "in &ledger.records {",
                "in ledger.records.iter()
        .filter(|(_, kept)| !(broken!(digests_are_of_live_records_only) && kept.record.is_ended())) {",
            ),
        ],
        "equal digests are equal records",
    ),
    view(
        "a_synchro_takes_the_place_of_what_was_known",
        &[edit(
            "view/mod.rs",
            "if self.ledgers.entry(*observer).or_default().join(ledger) {",
            "if records.is_synchro && broken!(a_synchro_takes_the_place_of_what_was_known) {
                self.ledgers.insert(*observer, ledger.clone());
                changed |= part_bit(*observer);
            } else if self.ledgers.entry(*observer).or_default().join(ledger) {",
        )],
        "no record is lost",
    ),
    view(
        "what_supersedes_is_ignored",
        &[and_not("view/standing.rs", "_ if covers(&self.empty)")],
        "nobody is certain of what was seen to be gone",
    ),
    view(
        "an_older_copy_takes_the_place_of_a_newer_one",
        &[and_not("view/record.rs", "Some(known) if known.record > kept.record")],
        "what has ended does not come back",
    ),
    view(
        "what_is_older_than_the_newest_is_refused",
        &[edit(
            "view/record.rs",
            "let is_room = self.records.len() < RECORDS_MAX;",
            "let is_newest = !self.records.values().any(|it| it.record.version > kept.record.version);
            let is_room = self.records.len() < RECORDS_MAX
                && (is_newest || !broken!(what_is_older_than_the_newest_is_refused));",
        )],
        "an earlier record that was lost is fetched though a later one came",
    ),
    view(
        "each_hello_asks_for_a_synchro",
        &[instead("team.rs", "self.differing(&hello.digests)", "u8::MAX")],
        "a team that agrees sends no synchro",
    ),
    view(
        "nobody_says_that_it_agrees",
        &[and_not("team.rs", "agrees: self.agrees_with_heard(now_ns)")],
        "a robot knows that its view is everybody's",
    ),
];

/// Robots that share exits out and go there.
const fn coordination(name: &'static str, edits: &'static [Edit], test: &'static str, says: &'static str) -> Mistake {
    Mistake { name, edits, test, says }
}

const CLAIMED: &str = "cores::simulation::campaign::whatever_robots_plan_no_two_that_hear_each_other_are_in_a_cell";
const MOVES: &str = "cores::simulation::blocking::an_intruder_that_moves_is_followed_and_nobody_changes_posts";
const UNUSED: &str = "cores::simulation::scenes::a_claim_that_is_not_used_ends";
const UNEQUAL: &str = "cores::simulation::scenes::robots_with_unequal_views_stand_until_they_are_equal";
const HEAD_ON: &str = "cores::simulation::scenes::two_head_on_in_a_corridor_pass_each_other_at_the_next_place";
const FRIENDS: &str = "cores::simulation::friends::a_friend_that_passes_is_no_intruder";
const CLAIMS: &str = "coordination/traffic/claims.rs";

const COORDINATION: &[Mistake] = &[
    coordination(
        "cells_are_left_to_others_with_a_robot_in_them",
        &[
            or(CLAIMS, "!held.contains(&claim.cell)"),
            and_not(CLAIMS, "|| self.fresh(now_ns).any(|(_, heard)| is_in_it(heard)"),
        ],
        CLAIMED,
        "no two that hear each other are in a cell",
    ),
    coordination(
        "no_echo_is_waited_for",
        &[or(CLAIMS, ".all(|(_, heard)| leaves_it(heard)")],
        CLAIMED,
        "no two that hear each other are in a cell",
    ),
    coordination(
        "claims_do_not_expire",
        &[or(CLAIMS, "now_ns.saturating_sub(heard.claimed_ns) <= self.settings.claim_ns")],
        UNUSED,
        "a claim that is not used ends",
    ),
    coordination(
        "robots_plan_on_unequal_views",
        &[or("coordination/traffic/mod.rs", "message.round == self.round && message.digest == digest")],
        UNEQUAL,
        "robots that know different things do not plan",
    ),
    coordination(
        "an_exit_is_given_to_whichever_robot_is_nearest_now",
        &[and_not("coordination/sharing.rs", "is_some_and(|steps| steps <= bound")],
        MOVES,
        "nobody changes posts",
    ),
    coordination(
        "robots_swap_in_a_step_of_a_plan",
        &[edit(
            "coordination/planning/pibt.rs",
            "if other == robot {
                return false;",
            "if other == robot {
                return broken!(robots_swap_in_a_step_of_a_plan);",
        )],
        HEAD_ON,
        "giving way begins within 10 s",
    ),
    coordination(
        "friends_are_intruders",
        &[and_not("view/look.rs", "filter(|friend| friend.can_be_at(obstacle, &self.settings)")],
        FRIENDS,
        "a friend that is heard is no intruder",
    ),
];
