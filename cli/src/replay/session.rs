//! A replay that runs: begun when its modules listen, watched to its end, summed up.

use super::configuration::{NODE, PlayedModules};
use crate::launch::TerminalView;
use crate::terminal::Failure;
use crate::terminal::speech::Speech;
use crate::terminal::units::short;
use rohrpost::interfaces::{ReplayInterface, ReplayPosition};
use rohrpost::wire::from_bytes;
use rohrpost::{CallError, Name};
use rohrpost_launch::Launch;
use std::time::{Duration, Instant};

/// Functions of the player that are called, by their numbers.
const POSITION: u16 = 16;
const PAUSE: u16 = 17;
const RESUME: u16 = 18;
/// Modules that run have subscribed by then, or they do not.
const LISTENING: Duration = Duration::from_secs(3);
/// The player is asked so often where it is.
const LOOK: Duration = Duration::from_millis(200);
/// Behind the end modules that run still have work.
const SETTLE: Duration = Duration::from_secs(1);

pub(super) struct ReplaySession {
    player: Name,
    /// Names that are played.
    played: Vec<Name>,
    /// Names that modules which run call, once for each of them: they are to have so many listeners.
    awaited: usize,
    has_running: bool,
    resumed: Option<Instant>,
    /// How long it took to the end.
    took: Option<Duration>,
    last: Option<ReplayPosition>,
}

impl ReplaySession {
    pub(super) fn new(launch: &Launch, player: &str, played: &PlayedModules) -> Result<Self, Failure> {
        let installation = launch.installation();
        let parse = |name: &str| installation.classes.parse_module(name);
        let player = parse(player)?;
        let has_values = |name: &Name| {
            let name = installation.classes.format(*name);
            played.topics.iter().any(|topic| topic.split('/').next() == Some(&name))
        };
        let names = played.described.keys().map(|name| parse(name)).collect::<Result<Vec<Name>, _>>()?;
        // Without those that are optional and not installed.
        let is_started = |name: Name| name != player && launch.phase(name).is_some();
        let running = || installation.modules_on(NODE).filter(|module| is_started(module.name));
        let calls = running().flat_map(|module| &module.calls);
        let awaited = calls.filter(|name| names.contains(name) && has_values(name)).count();
        let has_running = running().next().is_some();
        Ok(Self { player, played: names, awaited, has_running, resumed: None, took: None, last: None })
    }

    /// Until the recording is over, or a stop is requested.
    pub(super) fn watch(
        &mut self,
        launch: &mut Launch,
        speech: &Speech,
        is_quiet: bool,
        stays_paused: bool,
    ) -> Result<(), Failure> {
        let mut view = TerminalView::new(is_quiet, speech);
        let (began, mut look_at, mut settled_at) = (Instant::now(), Instant::now(), None::<Instant>);
        let mut is_held = true;
        while launch.watch(view.wait().min(LOOK)) {
            view.show(launch)?;
            let now = Instant::now();
            if settled_at.is_some_and(|at| now >= at) {
                break;
            }
            if now < look_at || settled_at.is_some() {
                continue;
            }
            look_at = now + LOOK;
            self.look(launch);
            // Somebody else may have resumed it.
            is_held &= self.resumed.is_none();
            if is_held && (now >= began + LISTENING || self.all_listen(launch)) {
                let go = if stays_paused { PAUSE } else { RESUME };
                is_held = self.call::<()>(launch, go).is_err();
            }
            if self.took.is_some() {
                settled_at = Some(if self.has_running { now + SETTLE } else { now });
            }
        }
        view.leave();
        Ok(())
    }

    /// Whether modules that run have subscribed, as far as others can see.
    fn all_listen(&self, launch: &mut Launch) -> bool {
        let Ok(survey) = launch.survey() else { return false };
        let is_played = |name: Name| self.played.contains(&name);
        let streams = survey.streams.iter().filter(|stream| is_played(stream.info.id.name));
        let readers: usize = streams.map(|stream| usize::from(stream.info.readers)).sum();
        let subscribers = launch.tool().status(self.player).map_or(0, |status| status.subscribers as usize);
        readers + subscribers >= self.awaited
    }

    /// Asks the player where it is.
    fn look(&mut self, launch: &mut Launch) {
        let Ok(position) = self.call::<ReplayPosition>(launch, POSITION) else { return };
        if !position.paused {
            self.resumed.get_or_insert_with(Instant::now);
        }
        // In a pause it stays at its end: it can be sought.
        if position.ended && !position.paused {
            self.took = Some(self.resumed.map_or(Duration::ZERO, |resumed| resumed.elapsed()));
        }
        self.last = Some(position);
    }

    fn call<T: serde::de::DeserializeOwned>(&self, launch: &mut Launch, function: u16) -> Result<T, CallError> {
        launch.tool().call(self.player, function, ReplayInterface::hash(), |_| Ok(()), |bytes| from_bytes(bytes))
    }

    /// What became of it, the result first.
    pub(super) fn summary(&mut self, launch: &mut Launch) -> Result<String, Failure> {
        if self.took.is_none() {
            self.look(launch);
        }
        let Some(position) = &self.last else { return Err("the player did not say what it has played".into()) };
        let took = self.took.or_else(|| Some(self.resumed?.elapsed())).unwrap_or_default();
        let (played, channels, seconds) = (position.played, position.channels, took.as_secs_f64());
        let plural = if channels == 1 { "" } else { "s" };
        let mut text = format!("played {played} values of {channels} channel{plural} in {seconds:.1} s");
        if !position.ended {
            text.push_str(&format!(", to {:.1} s of {:.1} s", position.at_s, position.length_s));
        }
        if position.older > 0 {
            text.push_str(&format!(", and {} from before its beginning", position.older));
        }
        text.push('\n');
        let rate = position.rate;
        for (what, figures) in [
            (
                format!("error of spacing at rate {rate}"),
                [position.spacing_p50_ns, position.spacing_p99_ns, position.spacing_max_ns],
            ),
            (
                "without waits for a processor".into(),
                [position.spacing_own_p50_ns, position.spacing_own_p99_ns, position.spacing_own_max_ns],
            ),
        ] {
            if let [Some(p50), Some(p99), Some(max)] = figures.map(|ns| ns.map(|ns| short(ns as f64 / 1e9))) {
                text.push_str(&format!("{what}: p50 {p50}, p99 {p99}, max {max}\n"));
            }
        }
        if position.refused > 0 {
            text.push_str(&format!("{} values were too large or too late for their streams\n", position.refused));
        }
        if position.damages > 0 {
            text.push_str(&format!("{} places in the files could not be read\n", position.damages));
        }
        Ok(text)
    }
}
