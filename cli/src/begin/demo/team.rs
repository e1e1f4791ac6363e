//! `rohrpost demo --team 6`: robots that find each other without a server, while this command divides and joins their
//! network and kills their leader. Each is a system of its own, in a network namespace of its own.

mod robots;

use super::folder::Folder;
use crate::launch::LaunchedNodes;
use crate::terminal::speech::Speech;
use crate::terminal::table::table;
use crate::terminal::{Failure, say};
use robots::{AGE_BEATS, TeamRobot, address, installations, join, name};
use rohrpost_config::Installation;
use rohrpost_routers::lab::{Lab, NodeSpec, become_able};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// States are looked at so often.
const LOOK: Duration = Duration::from_millis(100);
/// Between agreement and the next event.
const PAUSE: Duration = Duration::from_secs(2);
/// What is not agreed by then is not waited for.
const LONGEST: Duration = Duration::from_secs(15);
/// Links of Ethernet.
const MTU: u16 = 1500;
/// Beats until robots that hear each other know leader and group, without loss.
const MERGE_BEATS: u32 = 2;
/// Beats until their views are equal then, and until each has heard it of the others.
const VIEW_BEATS: u32 = 3;
const HEAR_BEATS: u32 = 1;
/// Beats from a robot knowing to its next look, which publishes it.
const LOOK_BEATS: u32 = 1;

/// What is done to the team.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Event {
    Begin,
    Divide,
    Join,
    KillLeader,
    LeaderBack,
}

impl Event {
    const ALL: [Self; 5] = [Self::Begin, Self::Divide, Self::Join, Self::KillLeader, Self::LeaderBack];

    const fn text(self) -> &'static str {
        match self {
            Self::Begin => "all robots have started",
            Self::Divide => "the network is divided",
            Self::Join => "it is whole again",
            Self::KillLeader => "the leader's computer dies",
            Self::LeaderBack => "the leader is back",
        }
    }

    /// Beats until all tell the right leader and group, and that views are equal; robots that are gone count for
    /// `AGE_BEATS`.
    fn promised(self) -> [u32; 2] {
        let silence = if matches!(self, Self::Divide | Self::KillLeader) { AGE_BEATS } else { 0 };
        let group = silence + MERGE_BEATS + LOOK_BEATS;
        [group, group + VIEW_BEATS + HEAR_BEATS]
    }
}

/// An event, and what came of it.
struct TeamHappening {
    event: Event,
    at: Duration,
    since: Instant,
    /// Beats until all told the right leader and group, and that views are equal.
    beats: Option<[u32; 2]>,
}

pub(super) fn run(count: u8, long: Option<Duration>) -> Result<ExitCode, Failure> {
    let folder = Folder::new()?;
    let installations = installations(count, folder.path())?;
    let specs: Vec<NodeSpec> = (1..=count).map(|id| NodeSpec { name: name(id), address: address(id).into() }).collect();
    // Must run before the first thread; the speech has two.
    become_able()?;
    let lab = Lab::new(&specs, MTU)?;
    let speech = Speech::begin()?;
    let mut nodes = LaunchedNodes::begin(installations.iter().cloned(), lab, None, None, &speech)?;
    let mut happened = Vec::new();
    let watched = watch(&mut nodes, &installations, &speech, long, &mut happened);
    let code = nodes.stop();
    speech.settle();
    let is_all = watched? && happened.len() == Event::ALL.len();
    let is_kept = happened.iter().all(TeamHappening::is_kept);
    say(if is_all && is_kept { "The demo went well." } else { "The demo did not go well." });
    if !is_all {
        let missing = Event::ALL[happened.len()..].iter().map(|event| event.text());
        say(format_args!("no time for: {}", missing.collect::<Vec<_>>().join(", ")));
    }
    say(format_args!("\n{}", told(&happened)));
    Ok(if is_all && is_kept { code } else { ExitCode::FAILURE })
}

/// Lets all events happen, and goes on until the time is over, counted from when all robots run; false if they did not.
fn watch(
    nodes: &mut LaunchedNodes<'_>,
    installations: &[Arc<Installation>],
    speech: &Speech,
    long: Option<Duration>,
    happened: &mut Vec<TeamHappening>,
) -> Result<bool, Failure> {
    while !nodes.all_run() {
        if !nodes.watch(Duration::MAX) {
            return Ok(false);
        }
    }
    let mut robots = join(installations)?;
    let (began, mut calm_since) = (Instant::now(), Instant::now() - PAUSE);
    while nodes.watch(LOOK) {
        let is_over = long.is_some_and(|long| began.elapsed() >= long);
        robots.iter_mut().for_each(TeamRobot::look);
        if let Some(now) = happened.last_mut().filter(|last| last.is_under_way()) {
            now.beats = agreed(&robots);
            calm_since = Instant::now();
        } else if is_over {
            break;
        } else if calm_since.elapsed() >= PAUSE
            && let Some(event) = Event::ALL.get(happened.len())
        {
            speech.say(event.text());
            let_happen(*event, nodes, &mut robots)?;
            robots.iter_mut().for_each(TeamRobot::begin_to_count);
            // What one part sees while it is alone, the other hears later.
            for at in [1, robots.len() - 1] {
                robots[at].make_up(happened.len() as f64)?;
            }
            let (at, since) = (began.elapsed(), Instant::now());
            happened.push(TeamHappening { event: *event, at, since, beats: None });
        }
    }
    robots.into_iter().for_each(TeamRobot::leave);
    Ok(true)
}

impl TeamHappening {
    fn is_under_way(&self) -> bool {
        self.beats.is_none() && self.since.elapsed() < LONGEST
    }

    fn is_kept(&self) -> bool {
        let kept = |beats: [u32; 2]| beats.into_iter().zip(self.event.promised()).all(|(beats, most)| beats <= most);
        self.beats.is_some_and(kept)
    }
}

fn let_happen(event: Event, nodes: &mut LaunchedNodes<'_>, robots: &mut [TeamRobot]) -> Result<(), Failure> {
    let half = robots.len() / 2;
    let far: Vec<String> = robots[half..].iter().map(|robot| robot.node.clone()).collect();
    let far: Vec<&str> = far.iter().map(String::as_str).collect();
    match event {
        Event::Begin => {}
        Event::Divide => {
            nodes.lab().divide(&far)?;
            robots[half..].iter_mut().for_each(|robot| robot.part = 1);
        }
        Event::Join => {
            nodes.lab().unite(&far)?;
            robots.iter_mut().for_each(|robot| robot.part = 0);
        }
        Event::KillLeader => {
            robots[0].die();
            nodes.kill(&robots[0].node)?;
        }
        Event::LeaderBack => {
            nodes.start_again(&robots[0].node)?;
            while !nodes.all_run() && nodes.watch(LOOK) {}
            robots[0].come_back()?;
        }
    }
    Ok(())
}

/// Beats of the slowest robots, if all are right: each part of the network is one group with equal views.
fn agreed(robots: &[TeamRobot]) -> Option<[u32; 2]> {
    let alive = || robots.iter().filter(|robot| robot.is_alive());
    let part = |part| alive().filter(move |robot| robot.part == part).map(|robot| robot.id).collect::<Vec<u8>>();
    let parts = [part(0), part(1)];
    alive().try_fold([0; 2], |[group, views], robot| {
        let [own_group, own_views] = robot.agrees_since(&parts[robot.part])?;
        Some([own_group.max(group), own_views.max(views)])
    })
}

/// A row for each event.
fn told(happened: &[TeamHappening]) -> String {
    let row = |it: &TeamHappening| {
        let beats =
            it.beats.map_or(["never".to_owned(), "never".to_owned()], |beats| beats.map(|beats| beats.to_string()));
        let ([group, views], [group_most, views_most]) = (beats, it.event.promised().map(|most| most.to_string()));
        [format!("{:.1} s", it.at.as_secs_f64()), it.event.text().into(), group, group_most, views, views_most]
    };
    let heads = [">at", "what happened", ">group after beats", ">promised", ">equal views", ">promised"];
    format!(
        "{}Promised without loss: {MERGE_BEATS} beats until all know leader and group, {VIEW_BEATS} more\n\
         until views are equal, {HEAR_BEATS} until all have heard that, {LOOK_BEATS} until they tell it;\n\
         {AGE_BEATS} before where robots fell silent.",
        table(heads, happened.iter().map(row))
    )
}
