//! Counters observed over time: shared by `hz`, `bw` and `delay`. Observing subscribes to nothing, and sends nothing to
//! modules.

use crate::terminal::Failure;
use crate::terminal::units::{Stop, seconds};
use rohrpost_mailbox::{FlowInfo, FlowSecond};
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// A sender's table keeps the extremes of a few seconds; this period misses none.
const LOOK: Duration = Duration::from_millis(250);
const LINE: Duration = Duration::from_secs(1);
/// A gap of this many intervals, and of this length, is silence and not an interval.
const SILENT_INTERVALS: f64 = 3.0;
const SILENT_NS: u64 = 100_000_000;

/// How long to watch.
#[derive(clap::Args)]
pub(crate) struct Pace {
    /// End after this many reports, one a second; each may have several lines.
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// End after this time.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Window of the figures, seconds.
    #[arg(long, default_value_t = 10.0, value_name = "SECONDS")]
    window: f64,
    /// One JSON object a line.
    #[arg(long)]
    pub(crate) json: bool,
}

impl Pace {
    pub(crate) fn window(&self) -> Result<Duration, Failure> {
        if self.window > 0.0 {
            seconds(self.window)
        } else {
            Err(format!("a window of {} s is empty; try --window 1", self.window).into())
        }
    }

    /// Observes repeatedly, and reports once a second, until it is time to end, Ctrl-C, or `tell` says that
    /// nobody reads any more.
    pub(crate) fn watch<W>(
        &self,
        watched: &mut W,
        mut look: impl FnMut(&mut W) -> Result<(), Failure>,
        mut tell: impl FnMut(&mut W) -> Result<bool, Failure>,
    ) -> Result<(), Failure> {
        let stop = Stop::new()?;
        let start = Instant::now();
        let end = self.seconds.map(seconds).transpose()?.and_then(|long| start.checked_add(long));
        let (mut reports, mut next_line) = (0, start + LINE);
        look(watched)?;
        loop {
            let now = Instant::now();
            let until = end.map_or(next_line, |end| end.min(next_line)).min(now + LOOK);
            if stop.within(until.saturating_duration_since(now)) {
                return Ok(());
            }
            look(watched)?;
            let now = Instant::now();
            let over = end.is_some_and(|end| now >= end);
            if !over && now < next_line {
                continue;
            }
            reports += 1;
            if !tell(watched)? || over || self.count.is_some_and(|count| reports >= count) {
                return Ok(());
            }
            while next_line <= now {
                next_line += LINE;
            }
        }
    }
}

/// The observations of the window, oldest first; the others are compared with the oldest.
pub(crate) struct Window<T> {
    seen: VecDeque<Observation<T>>,
    long: Duration,
}

struct Observation<T> {
    /// Monotonic clock.
    at_ns: u64,
    what: T,
}

impl<T> Window<T> {
    pub(crate) fn new(long: Duration) -> Self {
        Self { seen: VecDeque::new(), long }
    }

    /// Adds an observation at this time of the monotonic clock; if the source restarted, earlier ones are dropped.
    pub(crate) fn push(&mut self, at_ns: u64, what: T) {
        if self.seen.back().is_some_and(|last| at_ns < last.at_ns) {
            self.seen.clear();
        }
        self.seen.push_back(Observation { at_ns, what });
        let is_old = |seen: &Observation<T>| u128::from(at_ns.saturating_sub(seen.at_ns)) >= self.long.as_nanos();
        while self.seen.get(1).is_some_and(is_old) {
            self.seen.pop_front();
        }
    }

    /// The oldest and the newest.
    pub(crate) fn ends(&self) -> Option<(&T, &T)> {
        Some((&self.seen.front()?.what, &self.seen.back()?.what))
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
pub(crate) struct Tracks {
    long: Duration,
    tracks: Vec<Track>,
    began: bool,
}

impl Tracks {
    pub(crate) fn new(long: Duration) -> Self {
        Self { long, tracks: Vec::new(), began: false }
    }

    pub(crate) fn window(&self) -> Duration {
        self.long
    }

    /// Records the flows at this time of their node's monotonic clock; flows of ended processes are
    /// dropped.
    pub(crate) fn look(&mut self, at_ns: u64, flows: impl IntoIterator<Item = FlowInfo>) {
        let mut here = Vec::new();
        for flow in flows {
            let known = self.tracks.iter().position(|track| track.last.is_same(&flow));
            let mut track = match known {
                Some(at) => self.tracks.swap_remove(at),
                None => Track { window: Window::new(self.long), last: flow.clone(), seconds: BTreeMap::new() },
            };
            if known.is_none() && self.began {
                track.window.push(at_ns, None);
            }
            for second in &flow.seconds {
                track.seconds.insert(second.second, *second);
            }
            let oldest = at_ns.saturating_sub(self.long.as_nanos() as u64) / 1_000_000_000;
            track.seconds.retain(|second, _| *second + 2 >= oldest);
            track.window.push(at_ns, Some(flow.clone()));
            track.last = flow;
            here.push(track);
        }
        (self.tracks, self.began) = (here, true);
    }

    pub(crate) fn figures(&self) -> impl Iterator<Item = (&FlowInfo, FlowFigures)> {
        self.tracks.iter().map(|track| (&track.last, figures(&track.window, &track.seconds)))
    }
}

/// A flow's figures in the window. Rates and times are exact: they come from the sender's own clock.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlowFigures {
    pub(crate) packages: u64,
    pub(crate) bytes: u64,
    pub(crate) refused: u64,
    /// Packages a second, from the last before the window to the last in it; for a silent flow, until now. None without
    /// a package at either end.
    pub(crate) rate_hz: Option<f64>,
    /// From one package to the next; silence since the last is no interval.
    pub(crate) interval_mean_s: Option<f64>,
    pub(crate) interval_std_s: Option<f64>,
    /// Extremes of the seconds that overlap the window.
    pub(crate) interval_s: Option<(f64, f64)>,
    pub(crate) bytes_min_max: Option<(u32, u32)>,
    pub(crate) age_mean_s: Option<f64>,
    /// Times of the first and the last package of the rate.
    pub(crate) from_ns: u64,
    pub(crate) last_ns: u64,
    /// Time since the last package at the observation.
    pub(crate) since_last_s: f64,
    /// The same, if the next package is long overdue.
    pub(crate) silent_s: Option<f64>,
}

fn figures(window: &Window<Option<FlowInfo>>, seconds: &BTreeMap<u64, FlowSecond>) -> FlowFigures {
    let (Some(Observation { at_ns: began_ns, what: earlier }), Some(Observation { at_ns, what: Some(now) })) =
        (window.seen.front(), window.seen.back())
    else {
        return FlowFigures::default();
    };
    let before = |of: fn(&FlowInfo) -> u64| earlier.as_ref().map_or(0, of);
    let refused = now.refused.saturating_sub(before(|flow| flow.refused));
    let packages = now.packages.saturating_sub(before(|flow| flow.packages));
    let sent = earlier.as_ref().filter(|earlier| earlier.packages > 0);
    let from_ns = sent.map_or(now.first_ns, |earlier| earlier.last_ns);
    let intervals = if sent.is_some() { packages } else { packages.saturating_sub(1) };
    let interval_mean_s = now.rate_since(sent).map(|rate_hz| 1.0 / rate_hz);
    let squares = now.interval_squares_ns2.saturating_sub(sent.map_or(0, |earlier| earlier.interval_squares_ns2));
    let interval_std_s = interval_mean_s.map(|mean_s| {
        let mean_square_s2 = squares as f64 / intervals as f64 / 1e18;
        (mean_square_s2 - mean_s.powi(2)).max(0.0).sqrt()
    });
    let touched = || seconds.range(from_ns / 1_000_000_000..).map(|(_, second)| second).filter(|_| packages > 0);
    let both = |a: (u64, u64), b: (u64, u64)| (a.0.min(b.0), a.1.max(b.1));
    let interval_ns = touched().filter_map(|second| second.interval_ns).reduce(both);
    let bytes = touched().map(|second| second.bytes).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let age_ns = now.age_sum_ns.saturating_sub(before(|flow| flow.age_sum_ns));
    // There is no silence before the first package.
    let began_ns = sent.map_or(from_ns, |_| *began_ns);
    let times = FlowTimes { intervals, from_ns, began_ns, last_ns: now.last_ns, at_ns: *at_ns };
    let since_last_s = at_ns.saturating_sub(now.last_ns) as f64 / 1e9;
    FlowFigures {
        packages,
        bytes: now.bytes.saturating_sub(before(|flow| flow.bytes)),
        refused,
        rate_hz: interval_mean_s.and_then(|_| times.rate_hz()),
        interval_mean_s,
        interval_std_s,
        interval_s: interval_ns.map(|(min, max)| (min as f64 / 1e9, max as f64 / 1e9)),
        bytes_min_max: bytes,
        age_mean_s: (packages > 0).then(|| age_ns as f64 / packages as f64 / 1e9),
        from_ns,
        last_ns: now.last_ns,
        since_last_s,
        silent_s: times.is_silent().then_some(since_last_s),
    }
}

/// Times of a flow's packages and observations, on the monotonic clock.
struct FlowTimes {
    intervals: u64,
    /// The package before the first that counts, the first observation, the last package, the last observation.
    from_ns: u64,
    began_ns: u64,
    last_ns: u64,
    at_ns: u64,
}

impl FlowTimes {
    /// Whether this gap is silence, for a flow with this many packages in that time.
    fn is_silence(&self, gap_ns: u64, within_ns: u64) -> bool {
        let mean_ns = within_ns as f64 / self.intervals as f64;
        gap_ns > SILENT_NS && (self.intervals == 0 || gap_ns as f64 > SILENT_INTERVALS * mean_ns)
    }

    fn is_silent(&self) -> bool {
        self.is_silence(self.at_ns.saturating_sub(self.last_ns), self.last_ns.saturating_sub(self.counted_from_ns()))
    }

    /// The package before, unless silence followed it: then the beginning of the window.
    fn counted_from_ns(&self) -> u64 {
        let gap_ns = self.began_ns.saturating_sub(self.from_ns);
        let after = self.began_ns.max(self.from_ns);
        if self.is_silence(gap_ns, self.last_ns.saturating_sub(after)) { after } else { self.from_ns }
    }

    /// From one package to the last it is exact at any time; after the last, it includes silence.
    fn rate_hz(&self) -> Option<f64> {
        let until_ns = if self.is_silent() { self.at_ns } else { self.last_ns };
        let ns = until_ns.checked_sub(self.counted_from_ns())?;
        (self.intervals > 0 && ns > 0).then(|| self.intervals as f64 * 1e9 / ns as f64)
    }
}

impl FlowFigures {
    /// Bytes a second, exact.
    pub(crate) fn bytes_per_s(&self) -> Option<f64> {
        (self.packages > 0).then(|| self.rate_hz.map(|rate_hz| self.bytes as f64 / self.packages as f64 * rate_hz))?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn rate(intervals: u64, [from, began, last, at]: [f64; 4]) -> (Option<f64>, bool) {
        let ns = |seconds: f64| (seconds * S as f64) as u64;
        let times = FlowTimes { intervals, from_ns: ns(from), began_ns: ns(began), last_ns: ns(last), at_ns: ns(at) };
        (times.rate_hz(), times.is_silent())
    }

    #[test]
    fn an_active_flow_has_the_rate_from_package_to_package() {
        assert_eq!(rate(200, [99.99, 100.0, 109.99, 110.0]), (Some(20.0), false));
        // One interval may be late; a slow flow has long intervals.
        assert_eq!(rate(200, [99.99, 100.0, 109.99, 110.08]), (Some(20.0), false));
        assert_eq!(rate(5, [98.0, 100.0, 108.0, 110.0]), (Some(0.5), false));
    }

    #[test]
    fn a_stopped_flow_gets_slower_with_each_observation() {
        assert_eq!(rate(90, [100.0, 100.0, 104.0, 109.0]), (Some(10.0), true));
        // A burst of 0.1 s, and nothing for 0.9 s.
        assert_eq!(rate(100, [100.0, 100.0, 100.1, 101.0]), (Some(100.0), true));
        assert_eq!(rate(0, [50.0, 100.0, 50.0, 110.0]), (None, true));
    }

    #[test]
    fn a_flow_after_a_long_silence_counts_from_the_first_observation() {
        assert_eq!(rate(200, [5.0, 100.0, 110.0, 110.01]), (Some(20.0), false));
        assert_eq!(rate(2, [5.0, 100.0, 100.5, 104.0]), (Some(0.5), true));
    }
}
