//! The mistakes, each with the promise that it breaks. `broken!` asks whether its mistake is made. The first three are
//! the rules of the seed, [B1] to [B3] of the digest; the next two are what its code made of the kernel's timer, [B4].

use rohrpost_planted::{Edit, Mistake, and_not, before, edit, instead, left_out, or};

const fn wormhole(name: &'static str, edits: &'static [Edit], says: &'static str) -> Mistake {
    Mistake { name, edits, test: "a_mistaken_wormhole_keeps_its_promises", says }
}

pub(crate) const MISTAKES: &[Mistake] = &[
    // [B1]: nothing but the count since control was gained, so control is lost for ever anew.
    wormhole(
        "failures_in_a_window_are_not_counted",
        &[and_not("wormhole.rs", "if self.window.count(now_ns, self.settings.window_ns) >= most")],
        "too many failures in a window end in failed",
    ),
    // [B2]: a promise for an hour.
    wormhole(
        "promises_have_no_horizon",
        &[edit(
            "wormhole.rs",
            "now_ns.saturating_add(promise.duration_ns.min(self.settings.horizon_ns) - age_ns)",
            "now_ns.saturating_add(
                if broken!(promises_have_no_horizon) { promise.duration_ns }
                else { promise.duration_ns.min(self.settings.horizon_ns) } - age_ns,
            )",
        )],
        "a deadline is the promise's own, within the horizon",
    ),
    // [B3]: whatever value is let through.
    wormhole(
        "values_are_not_checked",
        &[and_not("wormhole.rs", "if !promise.command.is_finite()")],
        "a command in effect is a number",
    ),
    // [B4]: a wake-up is a timer that has run down, however early it is.
    wormhole(
        "each_wake_up_is_a_missed_deadline",
        &[edit(
            "wormhole.rs",
            "&& now_ns >= self.deadline_ns {",
            "&& (now_ns >= self.deadline_ns
            || broken!(each_wake_up_is_a_missed_deadline) && self.mode == Mode::Active) {",
        )],
        "each loss of control has one cause",
    ),
    // And an error of the timer is one more wake-up, at once.
    wormhole(
        "what_is_over_is_still_due",
        &[edit(
            "wormhole.rs",
            "self.wait_until_ns = None;
            change.restart",
            "if !broken!(what_is_over_is_still_due) { self.wait_until_ns = None; }
            change.restart",
        )],
        "nothing is due after a look",
    ),
    // ---- control ----
    wormhole(
        "a_newer_run_inherits_control",
        &[and_not("wormhole.rs", "let is_other_run = promise.order.incarnation != self.incarnation")],
        "control is of a run that has kept a promise",
    ),
    // What the core did before this model: the run was that of the last numbers, which a late promise uses up.
    wormhole(
        "a_newer_run_that_was_late_inherits_control",
        &[before("wormhole.rs", "return Err(Refusal::Late);", "self.incarnation = promise.order.incarnation;")],
        "control is of a run that has kept a promise",
    ),
    // This, too: between two looks a command was in effect for as long as the caller was late.
    wormhole(
        "deadlines_need_a_look",
        &[edit(
            "wormhole.rs",
            "self.mode == Mode::Active && now_ns < self.deadline_ns",
            "self.mode == Mode::Active && (now_ns < self.deadline_ns || broken!(deadlines_need_a_look))",
        )],
        "no command is in effect after its deadline",
    ),
    wormhole(
        "tests_have_no_deadline",
        &[edit(
            "wormhole.rs",
            "if matches!(self.mode, Mode::Test | Mode::Active) &&",
            "if (self.mode == Mode::Active || self.mode == Mode::Test && !broken!(tests_have_no_deadline)) &&",
        )],
        "a missed deadline ends control and test soon",
    ),
    wormhole(
        "tests_have_no_end",
        &[edit(
            "wormhole.rs",
            "            Mode::Test => {",
            "            Mode::Test if broken!(tests_have_no_end) => None,
            Mode::Test => {",
        )],
        "a driver that keeps its promises has control within two ticks",
    ),
    wormhole(
        "a_reset_ends_a_test",
        &[edit(
            "wormhole.rs",
            "if self.mode == Mode::Failed {
            self.mode = Mode::Disabled;",
            "if self.mode == Mode::Failed || broken!(a_reset_ends_a_test) && self.mode == Mode::Test {
            self.mode = Mode::Disabled;",
        )],
        "nothing else ends a test",
    ),
    wormhole(
        "nobody_is_told_of_a_loss",
        &[and_not("wormhole.rs", "let had_control = self.mode == Mode::Active")],
        "control is told as it comes and goes",
    ),
    wormhole(
        "the_blind_drive",
        &[edit("wormhole.rs", "let lost = if sees {", "let lost = if sees || broken!(the_blind_drive) {")],
        "no command is in effect without sight",
    ),
    wormhole(
        "a_command_outlives_a_take_over",
        &[edit(
            "wormhole.rs",
            "let lost = self.stand_by();",
            "let lost = if broken!(a_command_outlives_a_take_over) { None } else { self.stand_by() };",
        )],
        "a command in effect is of the driver in control",
    ),
    wormhole(
        "control_keeps_its_first_command",
        &[edit(
            "wormhole.rs",
            "self.command = promise.command;",
            "let keeps = broken!(control_keeps_its_first_command) && self.mode == Mode::Active;
        self.command = if keeps { self.command } else { promise.command };",
        )],
        "a command in effect is the one promised last",
    ),
    // ---- promises ----
    wormhole(
        "an_older_run_is_heard",
        &[or("promise.rs", "return if is_newer(self.incarnation, last.incarnation)")],
        "a promise is refused for what is wrong with it, and for nothing else",
    ),
    wormhole(
        "numbers_do_not_wrap",
        &[instead("promise.rs", "matches!(number.wrapping_sub(than), 1..0x8000_0000)", "number > than")],
        "what the model leaves out has no influence",
    ),
    wormhole(
        "a_refused_promise_forgives",
        &[before("wormhole.rs", "return Err(Refusal::OtherDriver);", "self.failures = 0;")],
        "a refused promise uses up numbers, and changes nothing",
    ),
    // ---- halts ----
    wormhole(
        "each_caller_lets_go_all",
        &[or("halts.rs", "**place == Some(id)")],
        "a halt holds until each caller lets go",
    ),
    wormhole("nobody_lets_go_all", &[left_out("halts.rs", "*self = Self::default();")], "nothing else holds"),
    // ---- restarts and failures ----
    wormhole(
        "a_person_is_blamed",
        &[or("wormhole.rs", "if self.driver == Driver::Program")],
        "only a deadline that the program missed is a failure",
    ),
    wormhole(
        "a_restart_waits_for_nothing",
        &[edit(
            "wormhole.rs",
            "now_ns >= until_ns || failed_often",
            "now_ns >= until_ns || failed_often || broken!(a_restart_waits_for_nothing)",
        )],
        "a restart is for a silent or a failing program",
    ),
    wormhole(
        "a_restart_begins_a_wait",
        &[edit(
            "wormhole.rs",
            "        self.failures = 0;
        self.program.last",
            "        self.failures = 0;
        if broken!(a_restart_begins_a_wait) { self.wait_anew(now_ns); }
        self.program.last",
        )],
        "a restart is asked for once in a silence",
    ),
    wormhole(
        "failed_waits_for_the_program",
        &[edit(
            "wormhole.rs",
            "(self.mode != Mode::Failed).then_some(until_ns)",
            "(self.mode != Mode::Failed || broken!(failed_waits_for_the_program)).then_some(until_ns)",
        )],
        "nothing is due in failed",
    ),
    wormhole(
        "a_miss_begins_no_wait",
        &[edit(
            "wormhole.rs",
            "self.count(now_ns);
            self.wait_anew(now_ns);",
            "self.count(now_ns);
            if !broken!(a_miss_begins_no_wait) { self.wait_anew(now_ns); }",
        )],
        "a silent program is restarted within the wait",
    ),
    wormhole(
        "a_failing_program_is_not_restarted",
        &[and_not("wormhole.rs", "self.failures > self.settings.failures_before_restart")],
        "a program that is to be restarted is, unless it has failed",
    ),
    wormhole(
        "failed_begins_too_early",
        &[edit(
            "wormhole.rs",
            "(self.settings.failures_max as usize)",
            "(self.settings.failures_max as usize - usize::from(broken!(failed_begins_too_early)))",
        )],
        "failed begins with too many failures",
    ),
    wormhole(
        "failed_ends_by_itself",
        &[or("wormhole.rs", "if self.mode != Mode::Failed")],
        "failed ends by a reset alone",
    ),
];
