//! Recordings: how much a recorder writes in a second without a loss, what of a processor each message takes, and
//! whether others notice it; what a journal costs a module, and how fast and how exactly recordings are replayed.

mod bare;
mod beside;
mod journal;
mod recorder;
mod replayed;
mod workload;

use nix::sys::resource::{UsageWho, getrusage};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, OrFail, Scratch, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, Target, at_least, at_most, compare};
use std::path::Path;
use std::time::{Duration, Instant};
use workload::Workload;

/// A speed, a line of output, a scan of a laser, a picture.
const SIZES: [usize; 4] = [100, 1000, 62_000, 4 << 20];
/// Bytes of a turn, unless its messages are small.
const TURN_BYTES: usize = 256 << 20;
const QUICK_BYTES: usize = 16 << 20;
/// Messages of a turn at most.
const TURN_MESSAGES: usize = 500_000;
/// A turn lasts a second or two.
const PATIENCE: Duration = Duration::from_secs(120);

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let rate = SIZES.map(|bytes| case("recorded", bytes, "MB/s", TurnFigure::Rate, at_least(0.9)));
    let time = SIZES.map(|bytes| case("recorded, processor", bytes, "us", TurnFigure::ProcessorTime, at_most(1.2)));
    let replayed = [replayed::exact(), replayed::spacing()];
    rate.into_iter().chain(time).chain([beside::case()]).chain(journal::cases()).chain(replayed).collect()
}

/// What of a turn is told.
#[derive(Clone, Copy, PartialEq, Eq)]
enum TurnFigure {
    Rate,
    ProcessorTime,
}

/// As many messages as a turn has, one after the other, all in the file.
fn case(name: &str, bytes: usize, unit: &'static str, figure: TurnFigure, target: Option<Target>) -> Case {
    Case::new(name, bytes, unit, move |settings, subject| {
        let turn_bytes = if settings.quick { QUICK_BYTES } else { TURN_BYTES };
        let messages = settings.count(TURN_MESSAGES.min(turn_bytes / bytes));
        let turn = |write: fn(&Path, &Workload) -> Result<(), Failure>| {
            move || {
                let folder = Scratch::new()?;
                let workload = Workload { bytes, messages };
                let samples = sample_in_child(PATIENCE, |samples| {
                    workload.prepare();
                    let (began, began_cpu) = (Instant::now(), processor_time()?);
                    write(&folder.directory(), &workload)?;
                    samples.push(began.elapsed().as_secs_f64());
                    samples.push((processor_time()? - began_cpu).as_secs_f64());
                    Ok(())
                })?;
                workload.check(&folder.directory())?;
                let [seconds, processor_s] = samples[..] else {
                    return Err(Failure::Failed(format!("{} figures of a turn, not 2", samples.len())));
                };
                Ok(match figure {
                    TurnFigure::Rate => (bytes * messages) as f64 / 1e6 / seconds,
                    TurnFigure::ProcessorTime => processor_s * 1e6 / messages as f64,
                })
            }
        };
        let ours = Contender::single("rohrpost", turn(recorder::write));
        let bare = Contender::single("mcap", turn(bare::write)).beside(target, None);
        Ok(compare(settings, subject, &[ours, bare]))
    })
}

/// What all threads of this process have taken of processors.
fn processor_time() -> Result<Duration, Failure> {
    let usage = getrusage(UsageWho::RUSAGE_SELF).or_fail("getrusage")?;
    let microseconds = [usage.user_time(), usage.system_time()]
        .map(|time| Duration::from_secs(time.tv_sec() as u64) + Duration::from_micros(time.tv_usec() as u64));
    Ok(microseconds.into_iter().sum())
}
