//! `rohrpost station info` and `quit`: each robot is asked until it answers, and told by name.

use super::link::StationLink;
use crate::look::target::Inquiry;
use crate::terminal::{Failure, complain, say};
use rohrpost::interfaces::{StationAnswer, StationRequest, StationRequestKind, StationState};
use rohrpost::output::plain;
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

/// The function of a station that asks robots.
pub(super) const ASK: u16 = 19;
/// Between two looks at what has been answered.
const POLL: Duration = Duration::from_millis(100);

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost station info 4\nExit code 1: a robot did not answer, or does not obey this \
    station.")]
pub(super) struct StationInfoArguments {
    /// The robot; without it, all that are heard.
    robot: Option<u8>,
    #[command(flatten)]
    inquiry: Inquiry,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost station quit 4
  rohrpost station quit --all
A robot that obeys stands, acknowledges it and ends; its programs are not started again. Exit code 1: a robot did not \
acknowledge it.")]
pub(super) struct QuitArguments {
    /// The robot.
    #[arg(required_unless_present = "all", conflicts_with = "all")]
    robot: Option<u8>,
    /// All robots that are heard.
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    inquiry: Inquiry,
}

/// How it stands with one robot, for programs.
#[derive(Serialize)]
struct RobotOutcome<'a> {
    robot: u8,
    answer: StationAnswer,
    text: &'a str,
}

pub(super) fn info(arguments: &StationInfoArguments) -> Result<ExitCode, Failure> {
    ask(&arguments.inquiry, StationRequestKind::Info, arguments.robot)
}

pub(super) fn quit(arguments: &QuitArguments) -> Result<ExitCode, Failure> {
    ask(&arguments.inquiry, StationRequestKind::Quit, arguments.robot)
}

fn ask(inquiry: &Inquiry, kind: StationRequestKind, robot: Option<u8>) -> Result<ExitCode, Failure> {
    let mut station = StationLink::find(inquiry)?;
    let number: u32 = station.call(ASK, &(kind, robot))?;
    loop {
        let state = station.state()?;
        match state.requests.iter().find(|request| request.number == number) {
            Some(request) if request.over => return tell(inquiry.json, &state, request),
            _ => std::thread::sleep(POLL),
        }
    }
}

/// What is bad goes to stderr, and first.
fn tell(json: bool, state: &StationState, request: &StationRequest) -> Result<ExitCode, Failure> {
    let text = |robot: u8| {
        let mut said = state.messages.iter().rev();
        let said = said.find(|said| said.robot == robot && said.answers == Some(request.number));
        said.map(|said| said.text.as_str()).unwrap_or_default()
    };
    let outcomes =
        request.robots.iter().map(|it| RobotOutcome { robot: it.robot, answer: it.answer, text: text(it.robot) });
    let outcomes: Vec<RobotOutcome<'_>> = outcomes.collect();
    let is_good = |outcome: &&RobotOutcome<'_>| matches!(outcome.answer, StationAnswer::Done | StationAnswer::Station);
    let code = if outcomes.iter().all(|it| is_good(&it)) { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    if json {
        say(serde_json::to_string(&outcomes)?);
        return Ok(code);
    }
    outcomes.iter().filter(|it| !is_good(it)).for_each(|it| complain(plain::line(&line(it, request))));
    for outcome in outcomes.iter().filter(is_good) {
        say(plain::line(&line(outcome, request)));
    }
    Ok(code)
}

fn line(outcome: &RobotOutcome<'_>, request: &StationRequest) -> String {
    let RobotOutcome { robot, answer, text } = outcome;
    match answer {
        StationAnswer::Done => format!("robot {robot}: {text}"),
        StationAnswer::Station => format!("robot {robot} is a station: not meant"),
        StationAnswer::Refused => format!("robot {robot} REFUSES: it {text}"),
        StationAnswer::Restarted => format!("robot {robot} was restarted meanwhile: ask again"),
        StationAnswer::GivenUp | StationAnswer::Waiting => {
            format!("robot {robot} has NOT ANSWERED, asked {} times: what it does, nobody knows", request.tries)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_outcome_is_told_by_name() {
        let request = StationRequest { tries: 20, ..StationRequest::default() };
        for (answer, text, told) in [
            (StationAnswer::Done, "ends", "robot 4: ends"),
            (StationAnswer::Station, "", "robot 4 is a station: not meant"),
            (StationAnswer::Refused, "obeys no station", "robot 4 REFUSES: it obeys no station"),
            (StationAnswer::Restarted, "", "robot 4 was restarted meanwhile: ask again"),
            (StationAnswer::GivenUp, "", "robot 4 has NOT ANSWERED, asked 20 times: what it does, nobody knows"),
        ] {
            assert_eq!(line(&RobotOutcome { robot: 4, answer, text }, &request), told);
        }
    }
}
