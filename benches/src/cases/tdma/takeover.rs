//! The master is killed again and again while all nodes send; then the master runs undisturbed for long, and must stay
//! the master.

use super::contest::BARE;
use super::goals::{Goal, figure, spread, subject};
use super::plans::LOADED;
use crate::tdma::bare::BareThreads;
use crate::tdma::capture::Capture;
use crate::tdma::rights::Rights;
use crate::tdma::routers::Routers;
use crate::tdma::stage::Stage;
use crate::tdma::takeover::{TakenOver, changes_of_master, kill_master, without_sync_percent};
use crate::tdma::traffic::Traffic;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, alone, rest};
use rohrpost_bench_local::rounds::{Row, Subject};
use rohrpost_bench_local::settings::Settings;
use std::time::Duration;

const FALSE_CHANGES: &str = "takeover, false changes";
const PER_CYCLES: &str = "in 1e5 cycles";

/// In each round.
const KILLS: usize = 10;
const KILLS_QUICK: usize = 2;
const KILLS_MAX: usize = 14;
/// In each round: 100 000 cycles in five.
const QUIET: Duration = Duration::from_secs(100);
const QUIET_QUICK: Duration = Duration::from_secs(1);
/// The step at which the moment of killing moves through the cycle.
const GOLDEN: f64 = 0.618_034;

/// The killed master. Each time the other takes its place and keeps it, so they alternate. Only a later one in the
/// order of masters stands in for a silent master in the same cycle, since its window comes later. An earlier one does
/// so in the next cycle.
const DEAD: [&str; 2] = ["the first dies", "the second dies"];

const REPLACED: [Goal; 2] = [Goal { name: "must 2 cycles", most: 2.0 }, Goal { name: "hoped 1, and 1 ms", most: 1.2 }];
const NEW_MASTER: [Goal; 2] =
    [Goal { name: "must 4 cycles", most: 4.0 }, Goal { name: "hoped 3, and 1 ms", most: 3.2 }];
const LOST: [Goal; 1] = [Goal { name: "hoped none", most: 0.0 }];
const STEP: [Goal; 1] = [Goal { name: "hoped 5 us", most: 5.0 }];
const FALSE: [Goal; 2] = [Goal { name: "must 1", most: 1.0 }, Goal { name: "hoped none", most: 0.0 }];
const WITHOUT_SYNC: [Goal; 1] = [Goal { name: "must 1 %", most: 1.0 }];

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("takeover", None, "cycles", takeover)]
}

/// Of all rounds.
#[derive(Default)]
struct Found {
    killed: Vec<TakenOver>,
    quiet_cycles: f64,
    false_changes: usize,
    /// Of bare threads, each of which could be the master, in as many cycles.
    standstills: Vec<f64>,
    /// Cycles without a captured Sync in the undisturbed part of each round, percent.
    without_sync: Vec<f64>,
}

fn takeover(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let mut found = Found::default();
    let watched = (0..settings.rounds.max(1)).try_for_each(|_| {
        let _alone = alone()?;
        watch(&Stage::new()?, settings, &mut found)
    });
    Ok(match watched {
        Ok(()) => found.rows(),
        Err(failure) => vec![Row::alone(subject.clone(), "all", Err(failure))],
    })
}

fn watch(stage: &Stage, settings: &Settings, found: &mut Found) -> Result<(), Failure> {
    let (kills, quiet) = if settings.quick { (KILLS_QUICK, QUIET_QUICK) } else { (KILLS, QUIET) };
    let mut routers = Routers::start(stage, &LOADED, Rights::RealTime, settings)?;
    let mut capture = Capture::start(stage)?;
    let traffic = Traffic::start(&routers)?;
    routers.await_packages(&mut capture)?;
    let mut found_here = Vec::new();
    // With few kills the same master may die each time, when masters change by themselves.
    let both_died = |killed: &[TakenOver]| (0..).zip(DEAD).all(|(dead, _)| killed.iter().any(|kill| kill.dead == dead));
    for kill in 0..KILLS_MAX {
        if kill >= kills && both_died(&found_here) {
            break;
        }
        let taken_over = kill_master(&mut routers, &mut capture, &LOADED, (kill as f64 * GOLDEN).fract())?;
        routers.start_again(taken_over.dead)?;
        // A returning node listens, follows, and sends again.
        routers.await_packages(&mut capture)?;
        found_here.push(taken_over);
    }
    found.killed.append(&mut found_here);
    let first = capture.len();
    rest(quiet)?;
    capture.check()?;
    let (frames, cycles) = (capture.since(first), quiet.as_micros() as f64 / LOADED.cycle_us as f64);
    found.false_changes += changes_of_master(&frames);
    found.without_sync.push(without_sync_percent(&frames, Duration::from_micros(LOADED.cycle_us), cycles));
    found.quiet_cycles += cycles;
    drop((traffic, capture, routers));
    let bare = BareThreads::turn(stage, &LOADED, false, quiet)?;
    found.standstills.push(bare.standstills as f64 * 1e5 / (cycles * f64::from(LOADED.masters)));
    Ok(())
}

impl Found {
    /// The results for this node as the killed master.
    fn killed(&self, contender: &'static str, dead: u8) -> Vec<Row> {
        let kills: Vec<&TakenOver> = self.killed.iter().filter(|kill| kill.dead == dead).collect();
        if kills.is_empty() {
            let never = Failure::Failed("it was never the master when one was killed".into());
            return vec![Row::alone(subject("takeover, replacement", "cycles"), contender, Err(never))];
        }
        let mut rows = Vec::new();
        let mut told = |what: &str, unit, goals: &[Goal], of: fn(&TakenOver) -> f64| {
            let all: Vec<f64> = kills.iter().map(|kill| of(kill)).collect();
            let worst = all.iter().copied().reduce(f64::max);
            rows.extend(spread(&subject(&format!("takeover, {what}"), unit), contender, all));
            rows.extend(figure(
                &subject(&format!("takeover, {what}, worst"), unit),
                contender,
                worst.as_slice(),
                goals,
            ));
        };
        told("replacement", "cycles", &REPLACED, |kill| kill.replaced_cycles);
        told("new master", "cycles", &NEW_MASTER, |kill| kill.new_master_cycles);
        told("slots lost", "slots", &LOST, |kill| kill.slots_lost as f64);
        told("time step", "us", &STEP, |kill| kill.step_us);
        rows
    }

    fn rows(&self) -> Vec<Row> {
        let mut rows: Vec<Row> =
            DEAD.iter().zip(0..).flat_map(|(contender, dead)| self.killed(contender, dead)).collect();
        let cycles = self.quiet_cycles;
        let seen = subject("takeover, cycles without Sync", "%");
        rows.extend(figure(&seen, "quiet", &self.without_sync, &WITHOUT_SYNC));
        // A node that sees no master sees no change of the master.
        if self.without_sync.iter().all(|percent| *percent <= WITHOUT_SYNC[0].most) {
            let changes = self.false_changes as f64 * 1e5 / cycles;
            rows.extend(figure(&subject(FALSE_CHANGES, PER_CYCLES), "quiet", &[changes], &FALSE));
        }
        // Others would take each of them for dead.
        let rounds = self.standstills.len();
        let mean = (rounds > 0).then(|| self.standstills.iter().sum::<f64>() / rounds as f64);
        rows.extend(figure(&subject(FALSE_CHANGES, PER_CYCLES), BARE, mean.as_slice(), &FALSE));
        rows.extend(figure(&subject("takeover, quiet", "cycles"), "quiet", &[cycles], &[]));
        rows.extend(figure(&subject("takeover, kills", "kills"), "all", &[self.killed.len() as f64], &[]));
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_saw_is_no_good_figure() {
        let kill = |dead| TakenOver { dead, replaced_cycles: 1.0, new_master_cycles: 3.0, slots_lost: 0, step_us: 1.0 };
        let cases = |killed: &[u8], without_sync| {
            let killed = killed.iter().map(|dead| kill(*dead)).collect();
            let rows =
                Found { killed, quiet_cycles: 200.0, without_sync: vec![0.0, without_sync], ..Found::default() }.rows();
            let has = |case: &str| rows.iter().any(|row| row.case == case);
            let failed = rows.iter().filter(|row| row.result.is_err()).map(|row| row.contender).collect::<Vec<_>>();
            let missed = rows.iter().any(|row| row.case == "takeover, cycles without Sync" && row.met() == Some(false));
            (has("takeover, false changes"), missed, failed)
        };
        assert_eq!(cases(&[0, 1], 1.0), (true, false, vec![]));
        assert_eq!(cases(&[0, 1], 1.5), (false, true, vec![]));
        assert_eq!(cases(&[0, 0], 0.0), (true, false, vec![DEAD[1]]));
    }
}
