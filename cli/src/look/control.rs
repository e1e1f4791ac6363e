//! How it stands with a robot's motor, as its supervisor tells it: in words.

use crate::look::target::Running;
use crate::terminal::table::table;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{ControlMode, ControlState, HeldHalt, SupervisorInterface};
use rohrpost::output::plain;
use rohrpost_mailbox::Name;

/// The function that tells it.
pub(crate) const STATE: u16 = 23;

/// The supervisor that a module is, under whichever of its names.
pub(crate) fn supervisor(running: &Running, module: Name) -> Option<Name> {
    let class = running.installation.classes.id(SupervisorInterface::CLASS)?;
    let known = running.installation.module(module);
    let names = known.map_or_else(|| vec![module], |known| known.names().collect());
    names.into_iter().find(|name| name.class() == class)
}

/// Those that hold the robot.
pub(crate) fn holders(halts: &[HeldHalt], has_unnamed: bool) -> String {
    let mut holders: Vec<&str> = halts.iter().map(|halt| halt.holder.as_str()).collect();
    holders.dedup();
    holders.extend(has_unnamed.then_some("others without a name"));
    plain::line(&holders.join(", ")).into_owned()
}

/// A row for each supervisor.
pub(crate) fn control_table<'a>(told: impl Iterator<Item = (&'a str, &'a ControlState)>) -> String {
    let rows = told.map(|(module, state)| {
        [
            module.to_owned(),
            plain::line(&state.driven_by).into_owned(),
            mode(state).into(),
            if state.sees { "yes" } else { "no" }.into(),
            holders(&state.halts, state.held_unnamed),
            state.failures.to_string(),
            state.lost.to_string(),
            state.restarts.to_string(),
            state.late_looks.to_string(),
        ]
    });
    let heads = [
        "supervisor",
        "driver",
        "control",
        "sees",
        "held by",
        ">failures",
        ">control lost",
        ">restarts",
        ">late looks",
    ];
    table(heads, rows)
}

/// What one supervisor does, and what it refused: lines with a word in front.
pub(crate) fn control_lines(state: &ControlState) -> Vec<(&'static str, String)> {
    let sees = if state.sees { "sees" } else { "does not see" };
    let mut lines = vec![
        ("driver", format!("{}, {}; the robot {sees}", plain::line(&state.driven_by), mode(state))),
        (
            "control",
            format!(
                "lost {} times, gained {}; {} failures since; {} restarts asked for; {} late looks",
                state.lost, state.gained, state.failures, state.restarts, state.late_looks
            ),
        ),
    ];
    if state.held_unnamed || !state.halts.is_empty() {
        lines.insert(0, ("held by", holders(&state.halts, state.held_unnamed)));
    }
    lines.extend(state.causes.iter().map(|cause| {
        let text = format!("{} times {}", cause.count, plain::line(&cause.cause));
        ("refused", text)
    }));
    lines
}

fn mode(state: &ControlState) -> &'static str {
    match state.mode {
        ControlMode::Disabled => "no control",
        ControlMode::Test => "in test",
        ControlMode::Active => "in control",
        ControlMode::Failed => "failed, until `reset`",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::interfaces::CauseCount;

    #[test]
    fn what_holds_the_robot_comes_first_and_each_refusal_has_its_line() {
        let halt = |holder: &str, number| HeldHalt { holder: holder.into(), number };
        let state = ControlState {
            mode: ControlMode::Active,
            driven_by: "pilot.0".into(),
            sees: true,
            halts: vec![halt("anna@desk", 1), halt("anna@desk", 2), halt("gui.0\u{1b}[2J", 1)],
            lost: 2,
            gained: 3,
            causes: vec![CauseCount { cause: "promise refused: late".into(), count: 7 }],
            ..ControlState::default()
        };
        let lines = control_lines(&state).into_iter().map(|(what, text)| format!("{what}: {text}"));
        assert_eq!(
            lines.collect::<Vec<_>>(),
            [
                r"held by: anna@desk, gui.0\u001b[2J",
                "driver: pilot.0, in control; the robot sees",
                "control: lost 2 times, gained 3; 0 failures since; 0 restarts asked for; 0 late looks",
                "refused: 7 times promise refused: late",
            ]
        );
    }
}
