//! `rohrpost demo --nodes 3 --chaos SEED`: faults of the program and of its computer, one after the other, drawn from a
//! seed. Physics and referee are a thread of this command, which no fault reaches.

mod fault;
mod referee;

use super::arguments::Arguments;
use super::copy;
use super::folder::Folder;
use crate::launch::{LaunchedNodes, lab};
use crate::terminal::speech::Speech;
use crate::terminal::table::{table, time};
use crate::terminal::{Failure, say};
use fault::{Draw, Fault, Robot};
use referee::Referee;
use rohrpost_config::Installation;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Control is looked at so often.
const LOOK: Duration = Duration::from_millis(20);
/// The program has control again if it has had it for so long.
const STEADY: Duration = Duration::from_millis(500);
/// Between two faults.
const PAUSE: Duration = Duration::from_secs(2);
/// No fault begins so shortly before the end, and none lasts longer.
const LONGEST: Duration = Duration::from_secs(12);

/// A fault, and what came of it.
struct Happening {
    fault: Fault,
    /// After the beginning of the run.
    at: Duration,
    since: Instant,
    /// Until the program lost control.
    lost: Option<Duration>,
    /// Until the program had control again.
    regained: Option<Duration>,
    is_repaired: bool,
}

pub(super) fn run(arguments: &Arguments, count: u8, seed: u64, long: Duration) -> Result<ExitCode, Failure> {
    let folder = Folder::new()?;
    let installation = Arc::new(copy::installation(arguments, folder.path())?);
    let nodes = installation.nodes.len();
    if nodes != usize::from(count) {
        return Err(format!("{} has {nodes} nodes; use --nodes {nodes}", installation.shown.display()).into());
    }
    // Must run before the first thread; the speech has two.
    let lab = lab(&installation)?;
    let speech = Speech::begin()?;
    let referee = Referee::begin(&installation)?;
    let mut nodes = LaunchedNodes::begin([installation.clone()], lab, arguments.impair, None, &speech)?;
    let happened = watch(&mut nodes, &installation, &speech, seed, long);
    let code = nodes.stop();
    speech.settle();
    let report = referee.end()?;
    let Some(happened) = happened? else { return Ok(ExitCode::FAILURE) };
    let is_regained = happened.iter().all(|happening| happening.regained.is_some());
    let is_well = report.counted == 0 && is_regained && !happened.is_empty();
    say(if is_well { "The demo went well." } else { "The demo did not go well." });
    say(super::super::arena::verdict(&report, long));
    say(format!("\n{}", told(&happened).trim_end()));
    Ok(if is_well { code } else { ExitCode::FAILURE })
}

/// Lets faults happen until the time is over, counted from when the program drives; none if not all modules ran.
fn watch(
    nodes: &mut LaunchedNodes<'_>,
    installation: &Arc<Installation>,
    speech: &Speech,
    seed: u64,
    long: Duration,
) -> Result<Option<Vec<Happening>>, Failure> {
    while !nodes.all_run() {
        if !nodes.watch(Duration::MAX) {
            return Ok(None);
        }
    }
    let (mut robot, mut draw) = (Robot::join(installation)?, Draw::new(seed));
    let mut happened: Vec<Happening> = Vec::new();
    let (mut began, mut quiet_since) = (None, Instant::now());
    while nodes.watch(LOOK) {
        let control_since = robot.control_since();
        if began.is_none() && control_since.is_some() {
            (began, quiet_since) = (Some(Instant::now()), Instant::now());
        }
        let Some(began) = began else { continue };
        if let Some(now) = happened.last_mut().filter(|last| last.is_under_way()) {
            now.look(control_since, &mut robot, nodes)?;
            quiet_since = Instant::now();
        } else if began.elapsed() >= long {
            break;
        } else if quiet_since.elapsed() >= PAUSE && began.elapsed() + LONGEST <= long {
            let fault = draw.next();
            speech.say(&format!("{fault}"));
            happened.push(Happening::begin(fault, began.elapsed(), &mut robot, nodes)?);
        }
    }
    robot.leave();
    Ok(Some(happened))
}

impl Happening {
    fn begin(fault: Fault, at: Duration, robot: &mut Robot, nodes: &mut LaunchedNodes<'_>) -> Result<Self, Failure> {
        let since = Instant::now();
        robot.let_happen(fault, nodes)?;
        Ok(Self { fault, at, since, lost: None, regained: None, is_repaired: false })
    }

    fn is_under_way(&self) -> bool {
        self.regained.is_none() && self.since.elapsed() < LONGEST
    }

    fn look(
        &mut self,
        control_since: Option<Instant>,
        robot: &mut Robot,
        nodes: &mut LaunchedNodes<'_>,
    ) -> Result<(), Failure> {
        if control_since.is_none() && self.lost.is_none() {
            self.lost = Some(self.since.elapsed());
        }
        if !self.is_repaired && self.since.elapsed() >= self.fault.lasts() {
            robot.repair(self.fault, nodes)?;
            self.is_repaired = true;
        }
        let is_lost = self.lost.is_some() || !self.fault.ends_control();
        let has_again = control_since.filter(|since| since.elapsed() >= STEADY);
        if let Some(since) = has_again.filter(|_| self.is_repaired && is_lost) {
            self.regained = Some(since.saturating_duration_since(self.since));
        }
        Ok(())
    }
}

/// A row for each fault.
fn told(happened: &[Happening]) -> String {
    let row = |happening: &Happening| {
        let Happening { fault, at, lost, regained, .. } = happening;
        let lasted = match (lost, regained) {
            (None, Some(_)) => ["kept".into(), String::new()],
            (lost, regained) => [*lost, *regained].map(|after| after.map_or_else(|| "never".into(), time)),
        };
        let [lost, regained] = lasted;
        [format!("{:.1} s", at.as_secs_f64()), fault.to_string(), lost, regained]
    };
    table([">at", "what happened", ">control lost after", ">had again after"], happened.iter().map(row))
}
