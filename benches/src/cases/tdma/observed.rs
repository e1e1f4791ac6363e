//! A turn of three nodes that always have something to send, watched from outside.

use crate::lan::junk::Junk;
use crate::tdma::capture::Capture;
use crate::tdma::counts::Counts;
use crate::tdma::kept::Kept;
use crate::tdma::plan::{PORT, Plan};
use crate::tdma::rights::Rights;
use crate::tdma::routers::Routers;
use crate::tdma::stage::Stage;
use crate::tdma::traffic::Traffic;
use rohrpost_bench_local::harness::{Failure, rest};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::time::Duration;

/// Length of a turn.
const WATCHED: Duration = Duration::from_secs(30);
const WATCHED_QUICK: Duration = Duration::from_secs(1);
/// Until routers know the delay of their datagrams to the wire, and the load is steady.
const SETTLES: Duration = Duration::from_secs(1);

/// Of packages and of time.
pub(super) const PORTS: [u16; 2] = [PORT, PORT + 1];

/// How routers run in a turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunConditions {
    /// How they may be scheduled.
    pub rights: Rights,
    /// Whether there is load on all processors and the network.
    pub loaded: bool,
    /// Whether junk arrives at the ports of a node.
    pub junk: bool,
}

/// What was seen.
#[derive(Clone, Debug)]
pub(super) struct Observed {
    /// By the capture.
    pub kept: Kept,
    /// By the routers themselves.
    pub counts: Counts,
    /// Of the processors' time, the hypervisor's, percent.
    pub steal_percent: f64,
    /// Wait of the slots' threads for a processor, in total, ms for each second.
    pub waited_ms_s: f64,
    /// Junk sent to each port, datagrams a second; none without junk.
    pub junk_s: Option<f64>,
}

/// Length of a turn.
pub(super) fn watched(settings: &Settings) -> Duration {
    if settings.quick { WATCHED_QUICK } else { WATCHED }
}

impl Observed {
    /// One turn, with routers of its own.
    ///
    /// # Errors
    /// When a part of it fails, or routers do not have the scheduling that they should.
    pub(super) fn turn(stage: &Stage, plan: &Plan, way: RunConditions, settings: &Settings) -> Result<Self, Failure> {
        let routers = Routers::start(stage, plan, way.rights, settings)?;
        let mut capture = Capture::start(stage)?;
        let _traffic = Traffic::start(&routers)?;
        routers.await_packages(&mut capture)?;
        let _load = way.loaded.then(|| stage.load()).transpose()?;
        let junk = way.junk.then(|| stage.junk(&PORTS)).transpose()?;
        rest(SETTLES)?;
        let time = routers.clock(0)?.record().ok_or_else(|| Failure::Failed("the master has no time".into()))?;
        let (counts, machine, first) = (routers.counts()?, routers.machine(), capture.len());
        rest(watched(settings))?;
        let (frames, machine_after) = (capture.since(first), routers.machine());
        let counts = Counts::between(&counts, &routers.counts()?);
        capture.check()?;
        let junk_s = junk.map(Junk::end).transpose()?;
        match (way.rights, counts.scheduled == "ordinary") {
            (Rights::RealTime, false) | (Rights::Ordinary, true) => {}
            (Rights::RealTime, true) => return Err(Failure::Skipped("no real time for routers here".into())),
            (Rights::Ordinary, false) => {
                return Err(Failure::Failed(format!("the kernel still schedules slots as `{}`", counts.scheduled)));
            }
        }
        Ok(Self {
            kept: Kept::of(&frames, &plan.tables()?, &time),
            steal_percent: machine_after.steal_percent(&machine),
            waited_ms_s: machine_after.waited_ms(&machine) / watched(settings).as_secs_f64(),
            counts,
            junk_s,
        })
    }

    /// How far off first frames were, µs.
    ///
    /// # Errors
    /// When there was none.
    pub(super) fn summary(&self) -> Result<Summary, Failure> {
        Summary::of(&mut self.kept.off_us.clone()).ok_or_else(|| Failure::Failed("no slot was used".into()))
    }

    /// Omitted slots, percent.
    pub(super) fn omitted_percent(&self) -> f64 {
        self.counts.omitted_percent()
    }

    /// Slots with a first frame further off than this, percent of the used slots.
    pub(super) fn further_off_percent(&self, than_us: f64) -> f64 {
        self.kept.further_off(than_us) as f64 * 100.0 / self.kept.off_us.len().max(1) as f64
    }

    /// Frames outside any window of their sender, percent.
    pub(super) fn outside_percent(&self) -> f64 {
        self.kept.outside as f64 * 100.0 / self.kept.frames.max(1) as f64
    }

    /// Frames in another's slot, percent.
    pub(super) fn in_anothers_percent(&self) -> f64 {
        self.kept.in_anothers as f64 * 100.0 / self.kept.frames.max(1) as f64
    }
}
