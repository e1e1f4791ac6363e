//! Recordings: how much a recorder writes in a second without a loss, what of a processor each message takes, and
//! whether others notice it; what a journal costs a module, and how fast and how exactly recordings are replayed.

mod bare;
mod beside;
mod journal;
mod recorder;
mod replayed;
mod workload;

use beside::PairBeside;
use journal::NotedEvent;
use nix::sys::resource::{UsageWho, getrusage};
use replayed::Replayed;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, Scratch, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
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
pub fn all() -> Vec<Box<dyn Case>> {
    let cases = |figure| SIZES.map(|bytes| -> Box<dyn Case> { Box::new(Recorded { bytes, figure }) });
    let others: [Box<dyn Case>; 5] = [
        Box::new(PairBeside),
        Box::new(NotedEvent::OneProcessor),
        Box::new(NotedEvent::Woken),
        Box::new(Replayed::Exact),
        Box::new(Replayed::Spacing),
    ];
    cases(TurnFigure::Rate).into_iter().chain(cases(TurnFigure::ProcessorTime)).chain(others).collect()
}

/// What of a turn is told.
#[derive(Clone, Copy, PartialEq, Eq)]
enum TurnFigure {
    Rate,
    ProcessorTime,
}

/// As many messages as a turn has, one after the other, all in the file.
struct Recorded {
    bytes: usize,
    figure: TurnFigure,
}

impl Case for Recorded {
    fn name(&self) -> String {
        match self.figure {
            TurnFigure::Rate => "recorded".into(),
            TurnFigure::ProcessorTime => "recorded, processor".into(),
        }
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let turn_bytes = if settings.quick { QUICK_BYTES } else { TURN_BYTES };
        let messages = settings.count(TURN_MESSAGES.min(turn_bytes / self.bytes));
        let turn = |write: fn(&Path, &Workload) -> Result<(), Failure>| {
            move || {
                let folder = Scratch::new()?;
                let workload = Workload { bytes: self.bytes, messages };
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
                Ok(match self.figure {
                    TurnFigure::Rate => (self.bytes * messages) as f64 / 1e6 / seconds,
                    TurnFigure::ProcessorTime => processor_s * 1e6 / messages as f64,
                })
            }
        };
        let contenders =
            [Contender::single("rohrpost", turn(recorder::write)), Contender::single("mcap", turn(bare::write))];
        let (unit, target) = match self.figure {
            TurnFigure::Rate => ("MB/s", Target::AtLeast(0.9)),
            TurnFigure::ProcessorTime => ("us", Target::AtMost(1.2)),
        };
        let versus = Versus { name: contenders[1].name, p50: Some(target), p99: None };
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit };
        Ok(compare(settings, &subject, &contenders, &[versus]))
    }
}

/// What all threads of this process have taken of processors.
fn processor_time() -> Result<Duration, Failure> {
    let usage = getrusage(UsageWho::RUSAGE_SELF).map_err(|error| Failure::of("getrusage", error))?;
    let microseconds = [usage.user_time(), usage.system_time()]
        .map(|time| Duration::from_secs(time.tv_sec() as u64) + Duration::from_micros(time.tv_usec() as u64));
    Ok(microseconds.into_iter().sum())
}
