//! The mistakes, each with the promise that it breaks. `broken!` asks whether its mistake is made.

use rohrpost_planted::{Edit, Mistake, and_not, edit, instead, left_out, mistake, or};

const SIMULATION: &str = "cores::simulation::promises::there_are_never_two_and_soon_one_again";
const RESTARTED: &str = "cores::simulation::edges::a_restarted_program_is_another_candidate";
const ORDER: &str = "cores::simulation::edges::an_answer_from_the_future_or_an_older_one_changes_nothing";
const TWO: &str = "never two";
const OLDER: &str = "nothing older passes";

const fn model(name: &'static str, edits: &'static [Edit], says: &'static str) -> Mistake {
    Mistake { name, edits, test: "a_mistaken_lease_keeps_its_promises", says }
}

pub(crate) const MISTAKES: &[Mistake] = &[
    // ---- the witness ----
    model(
        "a_restarted_witness_forgets_its_grants",
        &[instead("lease/witness.rs", "now_ns.saturating_add(LEASE_MAX_NS)", "now_ns")],
        TWO,
    ),
    mistake(
        "a_late_release_ends_a_newer_lease",
        &[edit(
            "lease/witness.rs",
            "if ask.asked_ns <= grant.asked_ns => return None",
            "if ask.asked_ns <= grant.asked_ns && !broken!(a_late_release_ends_a_newer_lease) => return None",
        )],
        SIMULATION,
    ),
    mistake("questions_have_no_order", &[left_out("lease/witness.rs", "grant.asked_ns = ask.asked_ns;")], SIMULATION),
    mistake(
        "a_restarted_program_has_the_lease_of_its_run_before",
        &[edit(
            "lease/witness.rs",
            "if (grant.place, grant.run) != (ask.place, ask.run) =>",
            "if grant.place != ask.place || grant.run != ask.run && \
             !broken!(a_restarted_program_has_the_lease_of_its_run_before) =>",
        )],
        RESTARTED,
    ),
    model(
        "the_first_choice_takes_over_when_it_is_back",
        &[edit(
            "lease/witness.rs",
            "let mut grant = match self.grant {",
            "let is_better = |grant: &Grant| is_ready && ask.place < grant.place;
             let is_lost = |grant: &Grant| broken!(the_first_choice_takes_over_when_it_is_back) && is_better(grant);
             let mut grant = match self.grant.filter(|grant| !is_lost(grant)) {",
        )],
        TWO,
    ),
    mistake(
        "a_candidate_that_hears_nothing_keeps_the_lease",
        &[or("lease/message.rs", "self.asked_ns.saturating_sub(answered_ns) < lease_ns")],
        SIMULATION,
    ),
    mistake(
        "a_better_choice_that_is_dead_is_waited_for",
        &[and_not("lease/witness.rs", "now_ns.saturating_sub(*ready_ns) >= self.terms.lease_ns()")],
        SIMULATION,
    ),
    // ---- the candidate ----
    model(
        "a_lease_counts_from_the_answer",
        &[edit(
            "lease/candidate.rs",
            "let until_ns = answer.asked_ns",
            "let until_ns = (if broken!(a_lease_counts_from_the_answer) { now_ns } else { answer.asked_ns })",
        )],
        TWO,
    ),
    model(
        "errors_of_clocks_are_ignored",
        &[edit(
            "lease/terms.rs",
            "let error = self.rate_error_ppm as u64;",
            "let error = if broken!(errors_of_clocks_are_ignored) { 0 } else { self.rate_error_ppm as u64 };",
        )],
        TWO,
    ),
    mistake(
        "getting_off_takes_no_time",
        &[edit(
            "lease/terms.rs",
            ".saturating_sub(self.off_ns)",
            ".saturating_sub(if broken!(getting_off_takes_no_time) { 0 } else { self.off_ns })",
        )],
        SIMULATION,
    ),
    model(
        "an_answer_from_before_a_release_grants",
        &[and_not("lease/candidate.rs", "answer.asked_ns <= released_ns")],
        TWO,
    ),
    mistake("an_older_answer_shortens_the_lease", &[or("lease/candidate.rs", "held.until_ns < until_ns")], ORDER),
    mistake(
        "an_answer_to_the_run_before_grants",
        &[and_not("lease/candidate.rs", "answer.run != self.run")],
        RESTARTED,
    ),
    // ---- the fence ----
    model("data_are_not_fenced", &[and_not("lease/fence.rs", "if number.count < newest.count")], OLDER),
    mistake(
        "numbers_of_all_runs_of_the_witness_have_an_order",
        &[or("lease/fence.rs", "newest.witness == number.witness")],
        SIMULATION,
    ),
    mistake(
        "any_answer_tells_the_present_witness",
        &[and_not("lease/fence.rs", "self.asked_ns != Some(answer.asked_ns)")],
        SIMULATION,
    ),
    mistake(
        "a_late_answer_lowers_the_fence",
        &[and_not("lease/fence.rs", "newest.count >= answer.newest.count")],
        SIMULATION,
    ),
];
