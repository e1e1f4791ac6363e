//! Declared flows, while every node floods with a lower class: how late their packages are, beside the bounds that
//! `rohrpost check` computes for this very configuration.

use super::contest::BARE;
use super::goals::{Goal, NONE, figure, spread, subject};
use super::observed::watched;
use super::plans::FLOWS;
use crate::tdma::bare::BareThreads;
use crate::tdma::capture::{Arrived, Capture};
use crate::tdma::counts::Counts;
use crate::tdma::plan::{Declared, Plan};
use crate::tdma::rights::Rights;
use crate::tdma::routers::Routers;
use crate::tdma::stage::Stage;
use crate::tdma::talkers::{Talked, Talkers};
use crate::tdma::traffic::Traffic;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, Machine, alone, rest};
use rohrpost_bench_local::rounds::{Row, Subject};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::{Summary, median};
use std::time::{Duration, Instant};

/// Parts of a turn, each checked for time that the hypervisor took.
const WINDOW: Duration = Duration::from_secs(1);
const WITHIN: [Goal; 1] = [Goal { name: "must bound", most: 1.0 }];
const WITHIN_ALONE: [Goal; 1] = [Goal { name: "hoped bound", most: 1.0 }];
const NOT_VACUOUS: [Goal; 1] = [Goal { name: "must 3 times", most: 3.0 }];
const STOLEN: [Goal; 1] = [Goal { name: "must 1 %", most: 1.0 }];

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("flows", None, "us", flows)]
}

/// One turn.
struct FlowTurns {
    arrivals: Vec<Arrived>,
    counts: Counts,
    talked: Talked,
    /// Steal in each window, percent.
    windows: Vec<f64>,
    waited_ms_s: f64,
    bare: BareThreads,
}

fn flows(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let turn = |_| {
        let _alone = alone()?;
        watch(&Stage::new()?, settings)
    };
    match (0..settings.rounds.max(1)).map(turn).collect::<Result<Vec<_>, Failure>>() {
        Ok(turns) => rows(&turns),
        Err(failure) => Ok(vec![Row::alone(subject.clone(), "all", Err(failure))]),
    }
}

fn watch(stage: &Stage, settings: &Settings) -> Result<FlowTurns, Failure> {
    let routers = Routers::start(stage, &FLOWS, Rights::RealTime, settings)?;
    let mut capture = Capture::start(stage)?;
    let traffic = Traffic::start(&routers)?;
    routers.await_packages(&mut capture)?;
    let (counts, before) = (routers.counts()?, routers.machine());
    let talkers = Talkers::start(&routers, &FLOWS)?;
    let windows = steal_in_windows(watched(settings))?;
    let waited_ms_s = routers.machine().waited_ms(&before) / watched(settings).as_secs_f64();
    let talked = talkers.end()?;
    let counts = Counts::between(&counts, &routers.counts()?);
    capture.check()?;
    let arrivals = capture.arrivals();
    drop((traffic, capture, routers));
    let bare = BareThreads::turn(stage, &FLOWS, false, watched(settings))?;
    Ok(FlowTurns { arrivals, counts, talked, windows, waited_ms_s, bare })
}

/// Sleeps for so long. Returns what the hypervisor took in each window, percent.
fn steal_in_windows(all: Duration) -> Result<Vec<f64>, Failure> {
    let over = Instant::now() + all;
    let mut windows = Vec::new();
    while Instant::now() < over {
        let before = Machine::look(&[], "");
        rest(WINDOW)?;
        windows.push(Machine::look(&[], "").steal_percent(&before));
    }
    Ok(windows)
}

/// A flow of each node. Their bounds are the same, since their slots are.
pub(super) struct Measured {
    pub(super) name: &'static str,
    pub(super) bound_us: f64,
    pub(super) latencies_us: Vec<f64>,
}

/// Each flow of a plan, and what came of it.
pub(super) fn measured(plan: &Plan, arrivals: &[&[Arrived]]) -> Result<Vec<Measured>, Failure> {
    let installation = plan.installation()?;
    let bounds = rohrpost_config::bounds(&installation);
    let of = |Declared { class: (class, name), .. }: &Declared| {
        let own = bounds.iter().filter(|bound| installation.flows[bound.flow].from.class() == *class);
        let mut bound_us: f64 = 0.0;
        for bound in own {
            let latency = bound.latency.map_err(|why| Failure::of(name, why))?.latency;
            bound_us = bound_us.max(latency.as_nanos() as f64 / 1000.0);
        }
        let came = arrivals.iter().copied().flatten().filter(|came| came.class == class.0);
        let latencies_us = came.map(|came| came.at_ns.saturating_sub(came.published_ns) as f64 / 1000.0).collect();
        Ok(Measured { name, bound_us, latencies_us })
    };
    plan.flows.iter().map(of).collect()
}

fn rows(turns: &[FlowTurns]) -> Result<Vec<Row>, Failure> {
    let wake_up_us = p999(turns.iter().flat_map(|turn| turn.bare.late_us.iter().copied())).unwrap_or_default();
    let mut rows = Vec::new();
    let arrivals: Vec<&[Arrived]> = turns.iter().map(|turn| turn.arrivals.as_slice()).collect();
    for Measured { name, bound_us, latencies_us } in measured(&FLOWS, &arrivals)? {
        let case = format!("flows, {name}");
        let Some(p999_us) = p999(latencies_us.iter().copied()) else {
            let failure = Failure::Failed("nothing of it came".into());
            rows.push(Row::alone(subject(&case, "us"), "measured", Err(failure)));
            continue;
        };
        let beyond = latencies_us.iter().filter(|latency_us| **latency_us > bound_us).count();
        let beyond_percent = beyond as f64 * 100.0 / latencies_us.len() as f64;
        rows.extend(spread(&subject(&case, "us"), "measured", latencies_us.clone()));
        rows.extend(figure(&subject(&case, "us"), "bound", &[bound_us], &[]));
        rows.extend(beside_bound(&case, "measured", p999_us, bound_us, wake_up_us));
        rows.extend(figure(&subject(&format!("{case}, beyond bound"), "%"), "measured", &[beyond_percent], &[]));
        // Packages take longer when a slot was omitted; with these, any bound would look close.
        let within_us = p999(latencies_us.iter().copied().filter(|latency_us| *latency_us <= bound_us));
        let vacuous = within_us.map(|within_us| bound_us / within_us);
        let subject = subject(&format!("{case}, bound"), "of p99.9 within");
        rows.extend(figure(&subject, "bound", vacuous.as_slice(), &NOT_VACUOUS));
    }
    let published: u64 = turns.iter().map(|turn| turn.talked.published).sum();
    let lost = published - turns.iter().map(|turn| turn.talked.taken).sum::<u64>().min(published);
    rows.extend(figure(&subject("flows, lost", "packages"), "all", &[lost as f64], &NONE));
    rows.extend(figure(&subject("flows, published", "packages"), "all", &[published as f64], &[]));
    let omitted: Vec<f64> = turns.iter().map(|turn| turn.counts.omitted_percent()).collect();
    rows.extend(figure(&subject("flows, omitted", "%"), "all", &omitted, &[]));
    rows.extend(figure(&subject("flows, omitted", "%"), BARE, &bare_percent(turns), &[]));
    rows.extend(figure(&subject("flows, wake-up p99.9", "us"), BARE, &[wake_up_us], &[]));
    rows.extend(steal_rows(turns));
    Ok(rows)
}

/// The 99.9 % quantile; none of none.
pub(super) fn p999(samples: impl Iterator<Item = f64>) -> Option<f64> {
    Summary::of(&mut samples.collect::<Vec<_>>())?.p999
}

/// The slowest of a thousand packages of a flow, beside its bound and what waking up takes.
pub(super) fn beside_bound(
    case: &str,
    contender: &'static str,
    p999_us: f64,
    bound_us: f64,
    wake_up_us: f64,
) -> Vec<Row> {
    let row = |unit, most_us: f64, goals| {
        figure(&subject(&format!("{case}, p99.9"), unit), contender, &[p999_us / most_us], goals)
    };
    let within = row("of bound and wake-up", bound_us + wake_up_us, &WITHIN);
    [within, row("of bound", bound_us, &WITHIN_ALONE)].concat()
}

/// Slots of each turn that threads which only wake up would omit.
fn bare_percent(turns: &[FlowTurns]) -> Vec<f64> {
    turns.iter().map(|turn| turn.bare.omitted_percent()).collect()
}

/// Windows of a second in which the hypervisor took something, and how much.
fn steal_rows(turns: &[FlowTurns]) -> Vec<Row> {
    let windows: Vec<f64> = turns.iter().flat_map(|turn| turn.windows.iter().copied()).collect();
    let stolen_from: Vec<f64> = windows.iter().copied().filter(|percent| *percent > 0.0).collect();
    let share = stolen_from.len() as f64 * 100.0 / windows.len().max(1) as f64;
    let waited: Vec<f64> = turns.iter().map(|turn| turn.waited_ms_s).collect();
    let mut rows = figure(&subject("flows, seconds with steal", "%"), "all", &[share], &STOLEN);
    rows.extend(spread(&subject("flows, steal in these", "%"), "all", stolen_from));
    rows.extend(figure(&subject("flows, run delay", "ms/s"), "all", median(waited).as_slice(), &[]));
    rows
}
