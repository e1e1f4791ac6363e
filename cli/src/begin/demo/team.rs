//! `rohrpost demo --team 6`: robots that find each other without a server, wander, find an intruder and block it, while
//! this command divides and joins their network, and kills a payload and their leader. Each is a system of its own, in
//! a network namespace of its own; the arena in which they are simulated is another one.

mod intruder;
mod robots;

use super::folder::Folder;
use super::gui::{drawing, drawn};
use crate::launch::LaunchedNodes;
use crate::team::launch::{all, lab};
use crate::team::referee::{ArenaReferee, Verdict};
use crate::team::squad::{Squad, SquadFile, SquadNetwork};
use crate::terminal::speech::Speech;
use crate::terminal::table::table;
use crate::terminal::{Failure, say};
use robots::{AGE_BEATS, TeamRobot, join};
use rohrpost::interfaces::PayloadBeats;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime};

/// The file of the first robot, and the map that it names.
const TEAM: &str = include_str!("../../../../config/team.toml");
const HALL: &str = include_str!("../../../../config/hall.map");
/// What it is drawn into, as in other demos.
const DRAWING: &str = "rohrpost-demo.rrd";
/// States are looked at so often.
const LOOK: Duration = Duration::from_millis(100);
/// Between agreement and the next event.
const PAUSE: Duration = Duration::from_secs(1);
/// What is not agreed by then is not waited for.
const LONGEST: Duration = Duration::from_secs(15);
/// An intruder that is not blocked by then is not waited for.
const BLOCKED: Duration = Duration::from_secs(60);
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
    Intruder,
    Divide,
    Join,
    KillPayload,
    KillLeader,
    LeaderBack,
}

impl Event {
    const ALL: [Self; 7] =
        [Self::Begin, Self::Intruder, Self::Divide, Self::Join, Self::KillPayload, Self::KillLeader, Self::LeaderBack];

    const fn text(self) -> &'static str {
        match self {
            Self::Begin => "all robots have started",
            Self::Intruder => "an intruder comes",
            Self::Divide => "the network is divided",
            Self::Join => "it is whole again",
            Self::KillPayload => "a payload dies",
            Self::KillLeader => "the leader's computer dies",
            Self::LeaderBack => "the leader is back",
        }
    }

    /// Beats until all tell the right leader and group; robots that are gone count for `AGE_BEATS`. None of an
    /// intruder: it is to be found first.
    fn promised(self) -> Option<u32> {
        let silence = match self {
            Self::Intruder => return None,
            Self::Divide | Self::KillLeader => AGE_BEATS,
            Self::Begin | Self::Join | Self::KillPayload | Self::LeaderBack => 0,
        };
        Some(silence + MERGE_BEATS + LOOK_BEATS)
    }

    /// Beats until all tell that views are equal. Each look at an intruder changes views, so nothing is promised then.
    fn promised_views(self) -> Option<u32> {
        self.promised().filter(|_| self == Self::Begin).map(|group| group + VIEW_BEATS + HEAR_BEATS)
    }

    /// How long is waited for what is to come of it.
    fn longest(self) -> Duration {
        if self == Self::Intruder { BLOCKED } else { LONGEST }
    }
}

/// An event, and what came of it.
struct TeamHappening {
    event: Event,
    at: Duration,
    since: Instant,
    /// Beats until all told the right leader and group, and that views are equal, if they were then.
    beats: Option<(u32, Option<u32>)>,
}

pub(super) fn run(count: u8, long: Option<Duration>, has_gui: bool) -> Result<ExitCode, Failure> {
    let folder = Folder::new()?;
    std::fs::write(folder.path().join("hall.map"), HALL)?;
    let mut file = SquadFile::parse(TEAM, "built-in team.toml", folder.path().to_owned())?;
    if has_gui {
        file.draw(DRAWING)?;
    }
    let squad = file.write(Some(count), SquadNetwork::Namespaces, folder.path())?;
    // Must run before the first thread; the speech has two.
    let lab = lab(&squad)?;
    let speech = Speech::begin()?;
    let begun = SystemTime::now();
    let mut nodes = LaunchedNodes::begin(all(&squad), lab, None, None, &speech)?;
    let mut run = TeamRun { happened: Vec::new(), blocked: None, beats: PayloadBeats::default() };
    let watched = run.watch(&mut nodes, &squad, &speech, long);
    let code = nodes.stop();
    speech.settle();
    let verdict = watched?;
    let is_all = run.happened.len() == Event::ALL.len();
    let is_kept = run.happened.iter().all(TeamHappening::is_kept);
    let is_well = verdict.as_ref().is_some_and(|verdict| verdict.has_no_touch() && verdict.is_blocked());
    say(if is_all && is_kept && is_well { "The demo went well." } else { "The demo did not go well." });
    if let Some(verdict) = &verdict {
        say(verdict);
    }
    if !is_all {
        let missing = Event::ALL[run.happened.len()..].iter().map(|event| event.text());
        say(format_args!("no time for: {}", missing.collect::<Vec<_>>().join(", ")));
    }
    say(format_args!("\n{}", run.told()));
    drawn(drawing(&squad.arena), begun);
    Ok(if is_all && is_kept && is_well { code } else { ExitCode::FAILURE })
}

/// What happened in a run.
struct TeamRun {
    happened: Vec<TeamHappening>,
    /// How long after it came the intruder was blocked first.
    blocked: Option<Duration>,
    /// Of all robots together, as they told last.
    beats: PayloadBeats,
}

impl TeamRun {
    /// Lets all events happen, and goes on until the time is over, counted from when all robots run. What the referee
    /// said last; none if they did not begin.
    fn watch(
        &mut self,
        nodes: &mut LaunchedNodes<'_>,
        squad: &Squad,
        speech: &Speech,
        long: Option<Duration>,
    ) -> Result<Option<Verdict>, Failure> {
        while !nodes.all_run() {
            if !nodes.watch(Duration::MAX) {
                return Ok(None);
            }
        }
        let (mut robots, mut referee) = (join(&squad.robots)?, ArenaReferee::join(&squad.arena)?);
        let (began, mut calm_since) = (Instant::now(), Instant::now() - PAUSE);
        while nodes.watch(LOOK) {
            // What is under way at the end has some time left.
            let is_late = || began.elapsed() >= long.unwrap_or_default() + LONGEST;
            let is_over = long.is_some_and(|long| began.elapsed() >= long && (referee.is_blocked() || is_late()));
            robots.iter_mut().for_each(TeamRobot::look);
            referee.look();
            if let Some(now) = self.happened.last_mut().filter(|last| last.is_under_way()) {
                now.beats = now.event.came_of_it(&robots, &referee);
                calm_since = Instant::now();
            } else if is_over {
                break;
            } else if calm_since.elapsed() >= PAUSE
                && let Some(event) = Event::ALL.get(self.happened.len())
            {
                speech.say(event.text());
                event.happen(nodes, &mut robots, &mut referee)?;
                robots.iter_mut().for_each(TeamRobot::begin_to_count);
                let (at, since) = (began.elapsed(), Instant::now());
                self.happened.push(TeamHappening { event: *event, at, since, beats: None });
            }
            self.note_blocked(&referee, speech);
        }
        for told in robots.iter_mut().filter_map(TeamRobot::beats) {
            self.beats.beats += told.beats;
            self.beats.over_10_ms += told.over_10_ms;
            self.beats.over_50_ms += told.over_50_ms;
            self.beats.latest_us = self.beats.latest_us.max(told.latest_us);
        }
        robots.into_iter().for_each(TeamRobot::leave);
        Ok(Some(referee.leave()))
    }

    fn note_blocked(&mut self, referee: &ArenaReferee, speech: &Speech) {
        let came = self.happened.iter().find(|it| it.event == Event::Intruder);
        if let Some(came) = came.filter(|_| self.blocked.is_none() && referee.is_blocked()) {
            self.blocked = Some(came.since.elapsed());
            speech.say("all reachable entrances are held");
        }
    }

    /// A row for each event.
    fn told(&self) -> String {
        let row = |it: &TeamHappening| {
            let number = |beats: Option<u32>| beats.map(|beats| beats.to_string()).unwrap_or_default();
            let group = it.beats.map_or_else(|| "never".into(), |(group, _)| group.to_string());
            let (at, views) = (format!("{:.1} s", it.at.as_secs_f64()), it.beats.and_then(|(_, views)| views));
            let (group_most, views_most) = (number(it.event.promised()), number(it.event.promised_views()));
            [at, it.event.text().into(), group, group_most, number(views), views_most]
        };
        let heads = [">at", "what happened", ">group after beats", ">promised", ">equal views", ">promised"];
        let blocked = self.blocked.map_or_else(
            || "The intruder was not blocked.".to_owned(),
            |blocked| {
                format!("All entrances that robots could reach were held {:.1} s after it came.", blocked.as_secs_f64())
            },
        );
        let PayloadBeats { beats, over_10_ms, over_50_ms, latest_us } = self.beats;
        format!(
            "{}{blocked}\n{beats} beats: {over_10_ms} late by more than 10 ms, {over_50_ms} by more than 50 ms, the \
             latest by {:.1} ms\nPromised without loss: {MERGE_BEATS} beats until all know leader and group, \
             {VIEW_BEATS} more until views are equal, {HEAR_BEATS} until all have heard that, {LOOK_BEATS} until they \
             tell it; {AGE_BEATS} before where robots fell silent. Each look at an intruder changes views.",
            table(heads, self.happened.iter().map(row)),
            latest_us as f64 / 1e3,
        )
    }
}

impl TeamHappening {
    fn is_under_way(&self) -> bool {
        self.beats.is_none() && self.since.elapsed() < self.event.longest()
    }

    fn is_kept(&self) -> bool {
        let is_kept =
            |beats: Option<u32>, most: Option<u32>| most.is_none_or(|most| beats.is_some_and(|it| it <= most));
        let (promised, views_promised) = (self.event.promised(), self.event.promised_views());
        self.beats.is_some_and(|(group, views)| is_kept(Some(group), promised) && is_kept(views, views_promised))
    }
}

impl Event {
    /// Does it to the team.
    fn happen(
        self,
        nodes: &mut LaunchedNodes<'_>,
        robots: &mut [TeamRobot],
        referee: &mut ArenaReferee,
    ) -> Result<(), Failure> {
        let half = robots.len() / 2;
        let far: Vec<String> = robots[half..].iter().map(|robot| robot.node.clone()).collect();
        let far: Vec<&str> = far.iter().map(String::as_str).collect();
        match self {
            Self::Begin => {}
            Self::Intruder => intruder::come(referee, HALL)?,
            Self::Divide => {
                nodes.lab()?.divide(&far)?;
                robots[half..].iter_mut().for_each(|robot| robot.part = 1);
            }
            Self::Join => {
                nodes.lab()?.unite(&far)?;
                robots.iter_mut().for_each(|robot| robot.part = 0);
            }
            Self::KillPayload => robots[half].kill_payload()?,
            Self::KillLeader => {
                robots[0].die();
                nodes.kill(&robots[0].node)?;
            }
            Self::LeaderBack => {
                nodes.start_again(&robots[0].node)?;
                while !nodes.all_run() && nodes.watch(LOOK) {}
                robots[0].come_back()?;
            }
        }
        Ok(())
    }

    /// Beats until what is to come of it has come.
    fn came_of_it(self, robots: &[TeamRobot], referee: &ArenaReferee) -> Option<(u32, Option<u32>)> {
        let has_come = |views: Option<u32>| match self {
            Self::Intruder => referee.is_blocked(),
            _ => views.is_some() || self.promised_views().is_none(),
        };
        agreed(robots).filter(|(_, views)| has_come(*views))
    }
}

/// Beats of the slowest robots, if all are right: each part of the network is one group. `None` of views that differ.
fn agreed(robots: &[TeamRobot]) -> Option<(u32, Option<u32>)> {
    let alive = || robots.iter().filter(|robot| robot.is_alive());
    let part = |part| alive().filter(move |robot| robot.part == part).map(|robot| robot.id).collect::<Vec<u8>>();
    let parts = [part(0), part(1)];
    alive().try_fold((0, Some(0)), |(group, views), robot| {
        let (own_group, own_views) = robot.agrees_since(&parts[robot.part])?;
        Some((own_group.max(group), views.zip(own_views).map(|(views, own)| own.max(views))))
    })
}
