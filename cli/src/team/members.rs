//! `rohrpost team`: what a robot knows of its team.

use super::{kill, launch};
use crate::look::newest;
use crate::look::target::Inquiry;
use crate::terminal::table::{table, time};
use crate::terminal::units::counted;
use crate::terminal::{Failure, say};
use rohrpost::interface::Interface;
use rohrpost::interfaces::{TeamClock, TeamInterface, TeamMember, TeamNotice, TeamNoticeKind, TeamObject, TeamState};
use rohrpost::types::Pose;
use rohrpost_team::{RobotId, Suspicion};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  rohrpost team
  rohrpost team team.0 --json
  rohrpost team launch config/team.toml --robots 8
`way`: how its hellos come, `direct` or through so many robots. `silent`: age of its newest hello. `clock`: its clock \
minus this robot's, and the greatest error. Exit code 1: the module does not answer, or views of the team differ."
)]
pub(crate) struct Arguments {
    /// Module of the team; without it, the only one of class `team`.
    name: Option<String>,
    #[command(flatten)]
    inquiry: Inquiry,
    #[command(subcommand)]
    command: Option<TeamCommand>,
}

#[derive(clap::Subcommand)]
enum TeamCommand {
    /// Launch all robots of a team on this computer, and the arena in which they are simulated.
    Launch(launch::Arguments),
    /// Kill all processes of a robot, as a cut of its power does.
    Kill(kill::Arguments),
    /// Halt all robots that run here.
    Stop,
    /// Let all robots go on that you halted.
    Resume,
}

/// A state for programs, with what it says together.
#[derive(Serialize)]
struct Told<'a> {
    module: &'a str,
    view_digest: String,
    views_equal: bool,
    #[serde(flatten)]
    state: &'a TeamState,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.command {
        Some(TeamCommand::Launch(arguments)) => return launch::run(arguments),
        Some(TeamCommand::Kill(arguments)) => return kill::run(arguments),
        Some(TeamCommand::Stop) => return kill::halt_all(true),
        Some(TeamCommand::Resume) => return kill::halt_all(false),
        None => {}
    }
    let running = arguments.inquiry.target.find()?;
    let module = running.module(arguments.name.as_deref().unwrap_or(TeamInterface::CLASS))?;
    let mut tool = running.join(arguments.inquiry.timeout()?)?;
    let (_, state) = newest(&mut tool, module, TeamInterface::STATE).map_err(|error| running.told(module, &error))?;
    let views_equal = state.differs_ms.is_none();
    if arguments.inquiry.json {
        let told = Told { module: &running.text(module), view_digest: view_digest(&state), views_equal, state: &state };
        say(serde_json::to_string(&told)?);
    } else {
        say(text(&state).trim_end());
    }
    Ok(if views_equal { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn view_digest(state: &TeamState) -> String {
    state.digests.iter().map(|digest| format!("{digest:08x}")).collect()
}

/// The verdict, then a row for each robot, then what there is beside it.
fn text(state: &TeamState) -> String {
    format!("{}\n\n{}", verdict(state), tables(state))
}

/// Which group it is, and whether its robots agree.
pub(crate) fn verdict(state: &TeamState) -> String {
    let fresh = state.members.iter().filter(|member| member.fresh).count() + 1;
    let views = match state.differs_ms {
        None => "views are equal".to_owned(),
        Some(since_ms) => format!("views differ since {}", ms(since_ms)),
    };
    format!("group {} of {}, led by robot {}; {views}", state.group, counted(fresh as u64, "robot"), state.leader)
}

/// A row for each robot, then what there is beside it.
pub(crate) fn tables(state: &TeamState) -> String {
    let own = [state.robot.to_string(), "here".into(), String::new(), place(state.pose), String::new(), String::new()];
    let mut rows: Vec<(u8, [String; 6])> = state.members.iter().map(|member| (member.robot, row(member))).collect();
    rows.push((state.robot, own));
    rows.sort_unstable();
    let heads = [">robot", "way", ">silent", "place", ">place's age", ">clock"];
    let mut text = table(heads, rows.into_iter().map(|(_, row)| row));
    text += &state.notices.iter().map(|notice| format!("\n{}", notice_text(*notice))).collect::<String>();
    let objects: Vec<[String; 5]> = state.objects.iter().map(|object| object_row(object, state)).collect();
    if !objects.is_empty() {
        text += &format!("\n{}", table(["object", "place", "state", ">seen", "by"], objects));
    }
    if state.more_objects > 0 {
        text += &format!("and {} more objects\n", state.more_objects);
    }
    text
}

fn row(member: &TeamMember) -> [String; 6] {
    let way = match (member.fresh, member.direct, member.hops) {
        (false, ..) => "out of contact".into(),
        (true, true, _) => "direct".into(),
        (true, false, hops) => format!("{hops} between"),
    };
    let pose_age = member.pose.map_or_else(String::new, |_| ms(member.pose_age_ms));
    let clock = member.clock.map_or_else(|| "?".into(), clock_text);
    [member.robot.to_string(), way, ms(member.silent_ms), place(member.pose), pose_age, clock]
}

fn object_row(object: &TeamObject, of: &TeamState) -> [String; 5] {
    let id = &object.id;
    let state = match (object.fake, object.may_be, object.certain) {
        (true, ..) => "made up".into(),
        (false, Some(robot), _) => suspicion_text(robot, of),
        (false, None, true) => "certain".into(),
        (false, None, false) => "uncertain".into(),
    };
    let by: Vec<String> = object.observers.iter().map(u8::to_string).collect();
    let place = format!("{:.2}, {:.2}", object.x_m, object.y_m);
    [format!("{}-{}.{}", id.observer, id.incarnation, id.number), place, state, ms(object.seen_ms), by.join(" ")]
}

/// The words of [`Suspicion`].
fn suspicion_text(robot: u8, of: &TeamState) -> String {
    let member = of.members.iter().find(|member| member.robot == robot);
    let silent_ns = member.map(|member| member.silent_ms.saturating_mul(1_000_000));
    RobotId::new(robot).map_or_else(|| "?".into(), |robot| Suspicion { robot, silent_ns }.to_string())
}

fn notice_text(TeamNotice { robot, kind }: TeamNotice) -> String {
    match kind {
        TeamNoticeKind::DuplicateId => format!("two robots have the number {robot}; change `id` of one's [system]"),
        TeamNoticeKind::OtherMap => format!("robot {robot} has another map; what it sees is not taken over"),
        TeamNoticeKind::OtherTree => format!("robot {robot} has another tree of events; its events are refused"),
        TeamNoticeKind::ClockOff => format!("robot {robot}'s clock is far from this robot's; ages do not depend on it"),
    }
}

fn place(pose: Option<Pose>) -> String {
    pose.map_or_else(|| "?".into(), |Pose { x_m, y_m, .. }| format!("{x_m:.2}, {y_m:.2}"))
}

fn clock_text(TeamClock { offset_ns, bound_ns }: TeamClock) -> String {
    let sign = if offset_ns < 0 { "-" } else { "" };
    let [offset, bound] = [offset_ns.unsigned_abs(), bound_ns].map(|ns| time(Duration::from_nanos(ns)));
    format!("{sign}{offset} ± {bound}")
}

fn ms(ms: u64) -> String {
    time(Duration::from_millis(ms))
}
