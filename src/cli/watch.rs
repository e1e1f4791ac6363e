//! Counters watched over time: what `hz`, `bw` and `delay` have in common. Looking sends nothing and subscribes to nothing.

use super::{Failure, call::seconds};
use rohrpost::launch::{Event, events};
use rohrpost::mailbox::{FlowInfo, FlowSecond, monotonic_ns};
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// A sender's table keeps the extremes of a few seconds; who looks so often misses none.
const LOOK: Duration = Duration::from_millis(250);
const LINE: Duration = Duration::from_secs(1);

/// How long to watch.
#[derive(clap::Args)]
pub(super) struct Pace {
    /// End after so many lines, one a second.
    #[arg(long, short, value_name = "N")]
    count: Option<u64>,
    /// End after so long.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Figures are those of the last so many seconds.
    #[arg(long, default_value_t = 10.0, value_name = "SECONDS")]
    window: f64,
    /// One JSON object a line.
    #[arg(long)]
    pub(super) json: bool,
}

impl Pace {
    pub(super) fn window(&self) -> Result<Duration, Failure> {
        if self.window > 0.0 {
            seconds(self.window)
        } else {
            Err("a window of 0 s holds nothing; try --window 1".into())
        }
    }

    /// Looks at once and then again and again, and tells what was seen once a second, until it is time to end, Ctrl-C, or
    /// `tell` says that nobody reads any more.
    pub(super) fn watch<W>(
        &self,
        watched: &mut W,
        mut look: impl FnMut(&mut W) -> Result<(), Failure>,
        mut tell: impl FnMut(&mut W) -> Result<bool, Failure>,
    ) -> Result<(), Failure> {
        let stop = events()?;
        let start = Instant::now();
        let end = self.seconds.map(seconds).transpose()?.and_then(|long| start.checked_add(long));
        let (mut lines, mut next_line) = (0, start + LINE);
        look(watched)?;
        loop {
            let now = Instant::now();
            let until = end.map_or(next_line, |end| end.min(next_line)).min(now + LOOK);
            if let Ok(Event::Stop) = stop.recv_timeout(until.saturating_duration_since(now)) {
                return Ok(());
            }
            look(watched)?;
            let now = Instant::now();
            let over = end.is_some_and(|end| now >= end);
            if !over && now < next_line {
                continue;
            }
            lines += 1;
            if !tell(watched)? || over || self.count.is_some_and(|count| lines >= count) {
                return Ok(());
            }
            while next_line <= now {
                next_line += LINE;
            }
        }
    }
}

/// What was seen in the last seconds, oldest first; the oldest is what the others are compared with.
pub(super) struct Window<T> {
    seen: VecDeque<(Instant, T)>,
    long: Duration,
}

impl<T> Window<T> {
    pub(super) fn new(long: Duration) -> Self {
        Self { seen: VecDeque::new(), long }
    }

    pub(super) fn push(&mut self, seen: T) {
        let now = Instant::now();
        self.seen.push_back((now, seen));
        while self.seen.get(1).is_some_and(|(at, _)| now.duration_since(*at) >= self.long) {
            self.seen.pop_front();
        }
    }

    /// The oldest and the newest.
    pub(super) fn ends(&self) -> Option<(&T, &T)> {
        Some((&self.seen.front()?.1, &self.seen.back()?.1))
    }
}

/// One flow in the window.
struct Track {
    /// None: before the flow began.
    window: Window<Option<FlowInfo>>,
    last: FlowInfo,
    seconds: BTreeMap<u64, FlowSecond>,
}

/// Some flows in the window.
pub(super) struct Tracks {
    long: Duration,
    tracks: Vec<Track>,
    began: bool,
}

impl Tracks {
    pub(super) fn new(long: Duration) -> Self {
        Self { long, tracks: Vec::new(), began: false }
    }

    /// Takes in what the flows are now; those that are gone (their process ended) are forgotten.
    pub(super) fn look(&mut self, flows: impl IntoIterator<Item = FlowInfo>) {
        let mut here = Vec::new();
        for flow in flows {
            let known = self.tracks.iter().position(|track| track.last.is_same(&flow));
            let mut track = match known {
                Some(at) => self.tracks.swap_remove(at),
                None => Track { window: Window::new(self.long), last: flow.clone(), seconds: BTreeMap::new() },
            };
            if known.is_none() && self.began {
                track.window.push(None);
            }
            for second in &flow.seconds {
                track.seconds.insert(second.second, *second);
            }
            let oldest = monotonic_ns().saturating_sub(self.long.as_nanos() as u64) / 1_000_000_000;
            track.seconds.retain(|second, _| *second + 2 >= oldest);
            track.window.push(Some(flow.clone()));
            track.last = flow;
            here.push(track);
        }
        (self.tracks, self.began) = (here, true);
    }

    /// The flows with their figures.
    pub(super) fn figures(&self) -> impl Iterator<Item = (&FlowInfo, Figures)> {
        self.tracks.iter().map(|track| (&track.last, track.figures()))
    }
}

/// What a flow did in the window. Rates and times are exact: they come from the sender's own clock.
#[derive(Clone, Debug, Default)]
pub(super) struct Figures {
    pub(super) packages: u64,
    pub(super) bytes: u64,
    pub(super) refused: u64,
    /// Packages a second from the last before the window to the last in it; none when there was none.
    pub(super) rate_hz: Option<f64>,
    pub(super) interval_std_s: Option<f64>,
    /// Of the seconds that the window touches.
    pub(super) interval_s: Option<(f64, f64)>,
    pub(super) bytes_min_max: Option<(u32, u32)>,
    pub(super) age_mean_s: Option<f64>,
    /// Of the package that the rate counts from, and of the last.
    pub(super) from_ns: u64,
    pub(super) last_ns: u64,
}

impl Track {
    fn figures(&self) -> Figures {
        let Some((earlier, Some(now))) = self.window.ends() else { return Figures::default() };
        let earlier = earlier.as_ref().filter(|earlier| earlier.packages > 0);
        let before = |of: fn(&FlowInfo) -> u64| earlier.map_or(0, of);
        let packages = now.packages.saturating_sub(before(|flow| flow.packages));
        let from_ns = earlier.map_or(now.first_ns, |earlier| earlier.last_ns);
        let rate_hz = now.rate_since(earlier);
        let squares =
            now.interval_squares_ns2.saturating_sub(earlier.map_or(0, |earlier| earlier.interval_squares_ns2));
        let intervals = if earlier.is_some() { packages } else { packages.saturating_sub(1) };
        let interval_std_s = rate_hz.map(|rate_hz| {
            let mean_square_s2 = squares as f64 / intervals as f64 / 1e18;
            (mean_square_s2 - rate_hz.powi(-2)).max(0.0).sqrt()
        });
        let touched =
            || self.seconds.range(from_ns / 1_000_000_000..).map(|(_, second)| second).filter(|_| packages > 0);
        let both = |a: (u64, u64), b: (u64, u64)| (a.0.min(b.0), a.1.max(b.1));
        let interval_ns = touched().filter_map(|second| second.interval_ns).reduce(both);
        let bytes = touched().map(|second| second.bytes).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let age_ns = now.age_sum_ns.saturating_sub(before(|flow| flow.age_sum_ns));
        Figures {
            packages,
            bytes: now.bytes.saturating_sub(before(|flow| flow.bytes)),
            refused: now.refused.saturating_sub(self.refused_before()),
            rate_hz,
            interval_std_s,
            interval_s: interval_ns.map(|(min, max)| (min as f64 / 1e9, max as f64 / 1e9)),
            bytes_min_max: bytes,
            age_mean_s: (packages > 0).then(|| age_ns as f64 / packages as f64 / 1e9),
            from_ns,
            last_ns: now.last_ns,
        }
    }

    fn refused_before(&self) -> u64 {
        self.window.ends().and_then(|(earlier, _)| earlier.as_ref()).map_or(0, |earlier| earlier.refused)
    }
}

impl Figures {
    /// Bytes a second, exact.
    pub(super) fn bytes_per_s(&self) -> Option<f64> {
        (self.packages > 0).then(|| self.rate_hz.map(|rate_hz| self.bytes as f64 / self.packages as f64 * rate_hz))?
    }

    /// Time since the last package, seconds.
    pub(super) fn silent_s(&self) -> f64 {
        monotonic_ns().saturating_sub(self.last_ns) as f64 / 1e9
    }
}
