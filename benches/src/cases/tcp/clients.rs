//! A thousand clients at once: throughput and delay; and whether a client that reads nothing, or a hostile program,
//! affects the others.

use crate::tcp::crowd::{Crowd, Habits};
use crate::tcp::hostile::Hostile;
use crate::tcp::systems::{Security, Systems};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, Machine};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::{Ratio, Summary, median};
use std::cell::RefCell;
use std::time::Duration;

const GUESTS: u16 = 1_000;
/// In a quick run.
const GUESTS_QUICK: u16 = 40;
const BYTES: usize = 64;
/// Packages a second that a thousand clients send: the rate that must be reached.
const PER_S: u64 = 50_000;
/// Packages a second where a case asks whether clients feel a disturbance or TLS: both processors have reserves, so
/// that the figures do not show a full processor.
const PER_S_BESIDE: u64 = 20_000;
const PER_S_QUICK: u64 = 1_000;
/// The router has reserves, so that the kernel's fair server stays out.
const COUNTED: Duration = Duration::from_secs(4);
const WARM_UP: Duration = Duration::from_secs(1);
/// Longer than a computer stalls.
const QUICK: Duration = Duration::from_secs(1);
/// The thread of the TCP router.
const THREAD: &str = "tcp-router";

const OURS: &str = "rohrpost";
const BOUND: (&str, f64) = ("5 ms", 5_000.0);
/// Share of all that was sent.
const RATE: (&str, f64) = ("of what is sent", 0.995);
const BESIDE: f64 = 1.2;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let habits =
        Habits { guests: GUESTS, per_s: PER_S, bytes: BYTES, one_stalls: false, warm_up: WARM_UP, counted: COUNTED };
    let plain = ClientTurn { contender: OURS, habits, security: Security::None, is_hostile: false };
    let beside = ClientTurn { habits: Habits { per_s: PER_S_BESIDE, ..habits }, ..plain };
    let sealed = ClientTurn { security: Security::Tls, ..beside };
    let stalled = ClientTurn { habits: Habits { one_stalls: true, ..beside.habits }, ..beside };
    let hostile = ClientTurn { is_hostile: true, ..beside };
    let without = |contender| Some(ClientTurn { contender, ..beside });
    let felt = at_most(BESIDE);
    vec![
        case("clients", true, plain, None, None),
        case("clients, sealed", true, sealed, without("not sealed"), None),
        case("clients, one stalled", false, stalled, without("none stalled"), felt),
        case("clients, hostile beside", false, hostile, without("nobody beside"), felt),
    ]
}

#[derive(Clone, Copy)]
struct ClientTurn {
    contender: &'static str,
    habits: Habits,
    security: Security,
    is_hostile: bool,
}

/// What a turn shows besides delays.
struct ClientFigures {
    contender: &'static str,
    sent_s: f64,
    came_s: f64,
    lost_percent: f64,
    steal_percent: f64,
    waited_ms_s: f64,
    hostile_s: Option<f64>,
}

/// Ours, beside another and its target, and beside the bound if it has one.
fn case(
    name: &'static str,
    is_bounded: bool,
    ours: ClientTurn,
    other: Option<ClientTurn>,
    felt: Option<Target>,
) -> Case {
    Case::new(name, BYTES, "us", move |settings, subject| {
        let seen = RefCell::new(Vec::new());
        let contender = |turn: ClientTurn| {
            let seen = &seen;
            Contender::sampled(turn.contender, move || {
                let (latencies, one) = turn.take(settings)?;
                seen.borrow_mut().push(one);
                Ok(latencies)
            })
        };
        let (bound, us) = BOUND;
        let limit = Contender::fixed(bound, Summary { p99: Some(us), ..Summary::single(us) });
        let limit = is_bounded.then(|| limit.beside(None, at_most(1.0)));
        let mut contenders = vec![contender(ours)];
        contenders.extend(limit);
        contenders.extend(other.map(|other| contender(other).beside(None, felt)));
        let mut rows = compare(settings, subject, &contenders);
        for turn in [Some(ours), other].into_iter().flatten() {
            let seen = seen.borrow();
            let own: Vec<&ClientFigures> = seen.iter().filter(|one| one.contender == turn.contender).collect();
            rows.extend(turn.rows(name, &own));
        }
        Ok(rows)
    })
}

impl ClientTurn {
    fn take(&self, settings: &Settings) -> Result<(Vec<f64>, ClientFigures), Failure> {
        let habits = self.habits(settings);
        let mut systems = Systems::start(settings, self.security)?;
        let mut crowd = Crowd::gather(&systems, habits)?;
        let mut hostile = self.is_hostile.then(|| Hostile::start(systems.address())).transpose()?;
        let mut connections = || hostile.as_mut().map(Hostile::connections).transpose();
        crowd.await_begin()?;
        let (machine, before) = (Machine::look(&[systems.router_pid()], THREAD), connections()?);
        crowd.await_end()?;
        let (after, connected) = (Machine::look(&[systems.router_pid()], THREAD), connections()?);
        let tally = crowd.finish()?;
        systems.check()?;
        let seconds = habits.counted.as_secs_f64();
        let (sent, came) = (tally.sent.get(), tally.came.get());
        let seen = ClientFigures {
            contender: self.contender,
            sent_s: sent as f64 / seconds,
            came_s: tally.meanwhile.get() as f64 / seconds,
            lost_percent: (sent - came) as f64 * 100.0 / sent.max(1) as f64,
            steal_percent: after.steal_percent(&machine),
            waited_ms_s: after.waited_ms(&machine) / seconds,
            hostile_s: before.zip(connected).map(|(before, after)| (after - before) as f64 / seconds),
        };
        Ok((tally.latencies.all(), seen))
    }

    fn habits(&self, settings: &Settings) -> Habits {
        let full = self.habits;
        if !settings.quick {
            return full;
        }
        Habits { guests: GUESTS_QUICK, per_s: PER_S_QUICK, warm_up: QUICK, counted: QUICK, ..full }
    }

    /// Rate, losses and the computer's load meanwhile; none without a turn.
    fn rows(&self, case: &str, seen: &[&ClientFigures]) -> Vec<Row> {
        let subject = |what: &str, unit| Subject { case: format!("{case}, {what}"), bytes: Some(BYTES), unit };
        let figure = |what: &str, unit, of: fn(&ClientFigures) -> Option<f64>| {
            let middle = median(seen.iter().filter_map(|one| of(one)))?;
            Some(Row::alone(subject(what, unit), self.contender, Ok(Summary::single(middle))))
        };
        let rate = figure("rate", "packages/s", |one| Some(one.came_s)).map(|row| {
            let rounds = seen.iter().map(|one| one.came_s / one.sent_s);
            let versus = Versus { name: RATE.0, p50: Some(Target::AtLeast(RATE.1)), p99: None };
            Row { versus: Some(versus), ratio_p50: Ratio::of(rounds), ..row }
        });
        let rows = [
            rate,
            figure("lost", "%", |one| Some(one.lost_percent)),
            figure("connections beside", "a second", |one| one.hostile_s),
            figure("steal", "%", |one| Some(one.steal_percent)),
            figure("run delay", "ms/s", |one| Some(one.waited_ms_s)),
        ];
        rows.into_iter().flatten().collect()
    }
}
