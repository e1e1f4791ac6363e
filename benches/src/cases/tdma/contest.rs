//! Contenders that differ in their slot table or in the scheduling of routers, observed in turn; and their rows.

use super::goals::{Goal, figure};
use super::observed::{Observed, RunConditions, watched};
use crate::tdma::bare::BareThreads;
use crate::tdma::plan::Plan;
use crate::tdma::rights::Rights;
use crate::tdma::stage::Stage;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::cell::RefCell;

/// One observed contender.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchedContender {
    /// Name in the table.
    pub contender: &'static str,
    /// Its slots.
    pub plan: Plan,
    /// How its routers run.
    pub way: RunConditions,
    /// Targets of the first one beside it.
    pub versus: &'static [[Option<Target>; 2]],
}

impl WatchedContender {
    /// With real-time scheduling, and without junk.
    pub(super) fn new(contender: &'static str, plan: Plan, loaded: bool) -> Self {
        let way = RunConditions { rights: Rights::RealTime, loaded, junk: false };
        Self { contender, plan, way, versus: &[] }
    }

    /// The first one stands beside this, once for each pair of targets.
    pub(super) fn beside(self, versus: &'static [[Option<Target>; 2]]) -> Self {
        Self { versus, ..self }
    }
}

fn with_targets<'a>(contender: Contender<'a>, versus: &[[Option<Target>; 2]]) -> Contender<'a> {
    versus.iter().fold(contender, |contender, [p50, p99]| contender.beside(*p50, *p99))
}

/// Another figure of a turn, besides how far off slots began.
#[derive(Clone, Copy, Debug)]
pub(super) struct Figure {
    /// Suffix of the case's name.
    pub what: &'static str,
    /// Unit of the figure.
    pub unit: &'static str,
    /// The figure.
    pub of: fn(&Observed) -> f64,
    /// Goals of contenders that have any.
    pub goals: &'static [Goal],
}

/// Figures of each case: whether nodes met on the wire, and the computer's load meanwhile.
pub(super) const ALWAYS: [Figure; 4] = [
    Figure {
        what: "outside its own",
        unit: "%",
        of: Observed::outside_percent,
        goals: &[Goal { name: "none", most: 0.0 }],
    },
    Figure {
        what: "in another's slot",
        unit: "%",
        of: Observed::in_anothers_percent,
        goals: &[Goal { name: "none", most: 0.0 }],
    },
    Figure { what: "steal", unit: "%", of: |seen| seen.steal_percent, goals: &[] },
    Figure { what: "run delay", unit: "ms/s", of: |seen| seen.waited_ms_s, goals: &[] },
];

/// The floor: threads that wake up for the slots of the first contender, under the same load, and send nothing.
pub(super) const BARE: &str = "bare threads";
const OMITTED: &str = "omitted";
/// A router that omits more slots than threads that do nothing else has an error. A round omits few slots, so the two
/// differ by chance.
const OF_BARE: [Goal; 1] = [Goal { name: "hoped 1.5", most: 1.5 }];

/// What was seen of a contender, round after round.
pub(super) type ObservedRounds = Vec<Observed>;

/// The result of a contest.
pub(super) struct Held {
    pub rows: Vec<Row>,
    /// Of each contender.
    pub seen: Vec<ObservedRounds>,
    /// Of the floor, round after round.
    pub bare: Vec<BareThreads>,
}

/// A case of this kind.
pub(super) struct Contest {
    /// Its name.
    pub case: &'static str,
    /// Those watched.
    pub watched: Vec<WatchedContender>,
    /// Goals apply to the first so many.
    pub with_goals: usize,
    /// The goals of slots: a name and figures, and the targets of the first one beside these.
    pub bounds: Vec<(&'static str, Summary, [Option<Target>; 2])>,
    /// Other figures.
    pub figures: Vec<Figure>,
}

impl Contest {
    /// Observes all, round after round.
    pub(super) fn hold(&self, settings: &Settings) -> Held {
        let stage = Stage::new();
        let all: Vec<RefCell<ObservedRounds>> = self.watched.iter().map(|_| RefCell::default()).collect();
        let turn = |at: usize| -> Result<Summary, Failure> {
            let WatchedContender { plan, way, .. } = &self.watched[at];
            let seen = Observed::turn(stage.as_ref().map_err(Clone::clone)?, plan, *way, settings)?;
            let summary = seen.summary()?;
            all[at].borrow_mut().push(seen);
            Ok(summary)
        };
        let turn = &turn;
        let contender = |(at, watched): (usize, &WatchedContender)| {
            with_targets(Contender::new(watched.contender, move || turn(at)), watched.versus)
        };
        let fixed = |&(name, bounds, [p50, p99]): &(&'static str, Summary, [Option<Target>; 2])| {
            Contender::fixed(name, bounds).beside(p50, p99)
        };
        let bare = RefCell::new(Vec::new());
        let floor = Contender::sampled(BARE, || {
            let WatchedContender { plan, way, .. } = &self.watched[0];
            let seen = BareThreads::turn(stage.as_ref().map_err(Clone::clone)?, plan, way.loaded, watched(settings))?;
            let late_us = seen.late_us.clone();
            bare.borrow_mut().push(seen);
            Ok(late_us)
        });
        let mut watched = self.watched.iter().enumerate().map(contender);
        let contenders = watched.next().into_iter().chain(self.bounds.iter().map(fixed)).chain(watched).chain([floor]);
        let contenders: Vec<Contender> = contenders.collect();
        let mut rows = compare(settings, &self.subject("us", None), &contenders);
        drop(contenders);
        let seen: Vec<ObservedRounds> = all.into_iter().map(RefCell::into_inner).collect();
        for figure in &self.figures {
            rows.extend(self.told(figure, &seen));
        }
        let bare = bare.into_inner();
        rows.extend(self.beside_bare(&seen[0], &bare));
        Held { rows, seen, bare }
    }

    /// Slots that bare threads would omit, and how many times as many the first contender omits.
    fn beside_bare(&self, seen: &ObservedRounds, bare: &[BareThreads]) -> Vec<Row> {
        let omitted: Vec<f64> = bare.iter().map(BareThreads::omitted_percent).collect();
        let mut rows = figure(&self.subject("%", Some(OMITTED)), BARE, &omitted, &[]);
        // A round without a late wake-up says nothing about their ratio.
        let both = seen.iter().map(Observed::omitted_percent).zip(omitted).filter(|(_, bare)| *bare > 0.0);
        let ratios: Vec<f64> = both.map(|(ours, bare)| ours / bare).collect();
        rows.extend(figure(&self.subject("of bare", Some(OMITTED)), self.watched[0].contender, &ratios, &OF_BARE));
        rows
    }

    /// The rows of a figure: contenders with goals beside these, others alone.
    fn told(&self, told: &Figure, seen: &[ObservedRounds]) -> Vec<Row> {
        let subject = self.subject(told.unit, Some(told.what));
        let rows = self.watched.iter().zip(seen).enumerate().map(|(at, (watched, seen))| {
            let rounds: Vec<f64> = seen.iter().map(told.of).collect();
            figure(&subject, watched.contender, &rounds, if at < self.with_goals { told.goals } else { &[] })
        });
        rows.flatten().collect()
    }

    /// As rows name it.
    pub(super) fn subject(&self, unit: &'static str, what: Option<&str>) -> Subject {
        let case = what.map_or_else(|| self.case.into(), |what| format!("{}, {what}", self.case));
        Subject { case, bytes: None, unit }
    }
}
