//! Replicas in time slots: how many records they carry beside what `rohrpost check` promises, and how late packages of
//! declared flows are beside them, and without them in the same slots.
//!
//! ```text
//!  n0, n1, n2: declared flows to the others, and a stream, faster than its slots carry it, that the next node has
//! ```
//! Nobody floods: what is not declared would leave before parts.

use super::flows::{Measured, beside_bound, measured, p999};
use super::goals::{NONE, figure, subject};
use super::observed::watched;
use super::plans::REPLICAS;
use super::slots::OMITTED;
use crate::tdma::bare::BareThreads;
use crate::tdma::capture::{Arrived, Capture};
use crate::tdma::counts::Counts;
use crate::tdma::records::RecordTraffic;
use crate::tdma::rights::Rights;
use crate::tdma::routers::Routers;
use crate::tdma::stage::Stage;
use crate::tdma::talkers::{Talked, Talkers};
use crate::tdma::traffic::Traffic;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, alone, rest};
use rohrpost_bench_local::rounds::{Row, Subject, Target, Versus};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::{Ratio, Summary, median};
use std::time::Duration;

/// Until nothing waits any more of what showed that all nodes send.
const SETTLES: Duration = Duration::from_secs(2);
/// A writer writes so many times what its slots carry for sure.
const OFFERED: f64 = 3.0;
const BESIDE: &str = "beside replicas";
const WITHOUT: &str = "without";
const PROMISED: &str = "check";
/// Past a replicated flood, beside unloaded: of the most urgent flow.
const URGENT: Versus = Versus { name: WITHOUT, p50: Some(Target::AtMost(1.5)), p99: Some(Target::AtMost(2.0)) };

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("replicas", None, "us", replicas)]
}

/// One turn.
struct ReplicaTurn {
    arrivals: Vec<Arrived>,
    talked: Talked,
    counts: Counts,
    /// Records of each node's stream that came whole, a second.
    records_s: Vec<f64>,
}

/// A turn of each contender, and how late bare threads wake up for the same slots after them, µs.
struct ReplicaRound {
    beside: ReplicaTurn,
    without: ReplicaTurn,
    late_us: Vec<f64>,
}

fn replicas(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let round = |number: usize| {
        let (_alone, stage) = (alone()?, Stage::new()?);
        // Each round begins with the other.
        let first = watch(&stage, settings, number.is_multiple_of(2))?;
        let second = watch(&stage, settings, !number.is_multiple_of(2))?;
        let (beside, without) = if number.is_multiple_of(2) { (first, second) } else { (second, first) };
        let late_us = BareThreads::turn(&stage, &REPLICAS, false, watched(settings))?.late_us;
        Ok(ReplicaRound { beside, without, late_us })
    };
    match (0..settings.rounds.max(1)).map(round).collect::<Result<Vec<_>, Failure>>() {
        Ok(rounds) => rows(&rounds),
        Err(failure) => Ok(vec![Row::alone(subject.clone(), BESIDE, Err(failure))]),
    }
}

/// Records of full size that slots carry for sure in a second, of the stream of each node.
fn promised() -> Result<f64, Failure> {
    let all = rohrpost_config::records_left(&REPLICAS.installation()?);
    let least = all.into_iter().flatten().reduce(f64::min);
    least.ok_or_else(|| Failure::Failed("a plan without replicas".into()))
}

fn watch(stage: &Stage, settings: &Settings, with_records: bool) -> Result<ReplicaTurn, Failure> {
    let routers = Routers::start(stage, &REPLICAS, Rights::RealTime, settings)?;
    let mut capture = Capture::start(stage)?;
    let traffic = Traffic::start(&routers)?;
    routers.await_packages(&mut capture)?;
    drop(traffic);
    let each = Duration::from_secs_f64(1.0 / (OFFERED * promised()?));
    let shape = REPLICAS.records.filter(|_| with_records);
    let mut records = shape.map(|shape| RecordTraffic::start(&routers, shape, each)).transpose()?;
    rest(SETTLES)?;
    let mut came = || records.as_mut().map(RecordTraffic::came).transpose();
    let (counts, before) = (routers.counts()?, came()?);
    let talkers = Talkers::start(&routers, &REPLICAS)?;
    rest(watched(settings))?;
    let after = came()?;
    let talked = talkers.end()?;
    let counts = Counts::between(&counts, &routers.counts()?);
    capture.check()?;
    let records_s = before.zip(after).map(|(before, after)| {
        let each = before.iter().zip(after).map(|(before, after)| after.saturating_sub(*before));
        each.map(|records| records as f64 / watched(settings).as_secs_f64()).collect()
    });
    Ok(ReplicaTurn { arrivals: capture.arrivals(), talked, counts, records_s: records_s.unwrap_or_default() })
}

fn rows(rounds: &[ReplicaRound]) -> Result<Vec<Row>, Failure> {
    let mut rows = record_rows(rounds)?;
    let wake_up_us = p999(rounds.iter().flat_map(|round| round.late_us.iter().copied())).unwrap_or_default();
    let each = rounds.iter().map(|round| {
        let of = |turn: &ReplicaTurn| measured(&REPLICAS, &[&turn.arrivals]);
        Ok([of(&round.beside)?, of(&round.without)?])
    });
    let each = each.collect::<Result<Vec<[Vec<Measured>; 2]>, Failure>>()?;
    for (at, flow) in REPLICAS.flows.iter().enumerate() {
        let latencies: Vec<[&Measured; 2]> = each.iter().map(|[beside, without]| [&beside[at], &without[at]]).collect();
        rows.extend(flow_rows(flow.class.1, (at == 0).then_some(URGENT), &latencies, wake_up_us));
    }
    for (contender, of) in [(BESIDE, (|round| &round.beside) as Turn), (WITHOUT, |round| &round.without)] {
        let lost: u64 =
            rounds.iter().map(|round| of(round).talked).map(|it| it.published.saturating_sub(it.taken)).sum();
        rows.extend(figure(&subject("replicas, packages lost", "packages"), contender, &[lost as f64], &NONE));
        let omitted: Vec<f64> = rounds.iter().map(|round| of(round).counts.omitted_percent()).collect();
        rows.extend(figure(&subject("replicas, omitted", "%"), contender, &omitted, OMITTED.goals));
    }
    rows.extend(figure(&subject("replicas, wake-up p99.9", "us"), super::contest::BARE, &[wake_up_us], &[]));
    Ok(rows)
}

type Turn = fn(&ReplicaRound) -> &ReplicaTurn;

/// Of the node with the fewest records.
fn record_rows(rounds: &[ReplicaRound]) -> Result<Vec<Row>, Failure> {
    let (promised, subject) = (promised()?, subject("replicas, records", "records/s"));
    let least: Vec<f64> =
        rounds.iter().filter_map(|round| round.beside.records_s.iter().copied().reduce(f64::min)).collect();
    let came = median(least.iter().copied()).map(Summary::single);
    let came = came.ok_or_else(|| Failure::Failed("not one round".into()));
    let versus = Some(Versus { name: PROMISED, p50: Some(Target::AtLeast(1.0)), p99: None });
    let ratio_p50 = Ratio::of(least.iter().map(|came| came / promised));
    Ok(vec![
        Row { versus, ratio_p50, ..Row::alone(subject.clone(), BESIDE, came) },
        Row::alone(subject, PROMISED, Ok(Summary::single(promised))),
    ])
}

/// A flow in each round: beside replicas, and without.
fn flow_rows(name: &str, versus: Option<Versus>, rounds: &[[&Measured; 2]], wake_up_us: f64) -> Vec<Row> {
    let case = format!("replicas, {name}");
    let all = |at: usize| rounds.iter().flat_map(move |round| round[at].latencies_us.iter().copied());
    let row = |at: usize, contender| {
        let summary = Summary::of(&mut all(at).collect::<Vec<_>>());
        let result = summary.ok_or_else(|| Failure::Failed("nothing of it came".into()));
        Row::alone(subject(&case, "us"), contender, result)
    };
    let summaries: Vec<[Summary; 2]> = rounds
        .iter()
        .filter_map(|round| {
            let [beside, without] = round.map(|measured| Summary::of(&mut measured.latencies_us.clone()));
            Some([beside?, without?])
        })
        .collect();
    let ratio = |of: fn(&Summary) -> Option<f64>| {
        Ratio::of(summaries.iter().filter_map(|[beside, without]| Some(of(beside)? / of(without)?)))
    };
    let versus = versus.unwrap_or(Versus { name: WITHOUT, p50: None, p99: None });
    let (ratio_p50, ratio_p99) = (ratio(|summary| Some(summary.p50)), ratio(|summary| summary.p99));
    let mut rows = vec![Row { versus: Some(versus), ratio_p50, ratio_p99, ..row(0, BESIDE) }, row(1, WITHOUT)];
    let bound_us = rounds.first().map_or(0.0, |[beside, _]| beside.bound_us);
    rows.extend(figure(&subject(&case, "us"), "bound", &[bound_us], &[]));
    for (contender, at) in [(BESIDE, 0), (WITHOUT, 1)] {
        if let Some(p999_us) = p999(all(at)) {
            rows.extend(beside_bound(&case, contender, p999_us, bound_us, wake_up_us));
        }
    }
    rows
}
