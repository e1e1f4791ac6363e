//! Contenders that differ in their slot table or in the scheduling of routers, observed in turn; and their rows.

use super::goals::{Goal, figure};
use super::observed::{Observed, RunConditions, watched};
use crate::tdma::bare::BareThreads;
use crate::tdma::plan::Plan;
use crate::tdma::stage::Stage;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Versus, compare};
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
    /// The goals of slots: a name and figures.
    pub bounds: Vec<(&'static str, Summary)>,
    /// Compared with the first one.
    pub versus: Vec<Versus>,
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
        let contender = |(at, watched): (usize, &WatchedContender)| Contender {
            name: watched.contender,
            turn: Box::new(move || turn(at)),
        };
        let fixed = |(name, bounds): &(&'static str, Summary)| {
            let bounds = *bounds;
            Contender { name, turn: Box::new(move || Ok(bounds)) }
        };
        let bare = RefCell::new(Vec::new());
        let floor = Contender::sampled(BARE, || {
            let WatchedContender { plan, way, .. } = &self.watched[0];
            let seen = BareThreads::turn(stage.as_ref().map_err(Clone::clone)?, plan, way.loaded, watched(settings))?;
            let late_us = seen.late_us.clone();
            bare.borrow_mut().push(seen);
            Ok(late_us)
        });
        let contenders = self.watched.iter().enumerate().map(contender).chain([floor]);
        let contenders: Vec<Contender> = contenders.chain(self.bounds.iter().map(fixed)).collect();
        let mut rows = compare(settings, &self.subject("us", None), &contenders, &self.versus);
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
