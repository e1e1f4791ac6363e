//! The slot core of the mailbox and the core of streams under ThreadSanitizer: their very source, with the processor's
//! atomics and real threads in one address space, since two mappings of one file are two memories to ThreadSanitizer.
//!
//! ```text
//!  mailbox/src/{word,slots,…,cell}.rs ─────┬── unchanged ──▶ every run ends, and nothing is reported
//!  src/{rig,runs}.rs ──────────────────────┤
//!  ../loom/src/broken/, one edit each ─────┴── edited ─────▶ a data race is reported (src/caught.rs says in which run)
//! ```
//!
//! The same for `mailbox/src/stream/{omission,ring,left_out,writing}.rs`, with `src/stream_rig.rs` and
//! `../loom/src/stream_broken.rs`.
//!
//! `cargo xtask tsan` builds and runs this. Each run is a process of its own. The standard library is not instrumented:
//! of it threads are used alone (ThreadSanitizer sees them begin and end), and no body passes through it.
//!
//! What this does not show: an order that no thread took, and what fences do, which ThreadSanitizer does not know. That
//! is what the models are for.

#[allow(unused, unreachable_pub)]
mod name {
    include!(concat!(env!("OUT_DIR"), "/name.rs"));
}
mod step;
#[path = "../../../src/sync.rs"]
mod sync;
#[allow(unused, unreachable_pub, clippy::all, clippy::unwrap_used)]
mod variants {
    include!(concat!(env!("OUT_DIR"), "/variants.rs"));
}
// Never compiled here, only beside each variant; named so that rustfmt finds them.
#[cfg(any())]
mod caught;
#[cfg(any())]
mod rig;
#[cfg(any())]
mod runs;
#[cfg(any())]
mod stream_rig;

use std::process::{Command, ExitCode, Output};
use std::time::{Duration, Instant};
use variants::{BROKEN, real, real_stream};

/// A run, and what it is called.
type Run = (&'static str, fn());

/// The sources as they are, each with its runs.
const REAL: [(&str, &[Run]); 2] = [("real", real::runs::ALL), ("real_stream", real_stream::stream_rig::ALL)];

/// A run takes seconds, on a busy computer half a minute; one that is broken may have no end.
const PATIENCE: Duration = Duration::from_secs(120);

/// For how long a thread does something again and again.
const ENOUGH: Duration = Duration::from_secs(10);

/// Numbers what a thread does so often. The environment variable makes it more or fewer, percent. On a busy computer it
/// is done less often: there each step that hands the processor over costs a time slice of another process.
fn rounds(usual: u64) -> impl Iterator<Item = u64> {
    let percent = std::env::var("ROHRPOST_RUN_PERCENT").ok().and_then(|text| text.parse().ok());
    let usually = if cfg!(test) { 5 } else { 200 };
    let began = Instant::now();
    (0..(usual * percent.unwrap_or(usually) / 100).max(1)).take_while(move |_| began.elapsed() < ENOUGH)
}

/// With names of a variant and a run, does it; without, does all, each in a process of its own, and checks.
fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments[..] {
        [] => validate(),
        [variant, run] => match find(variant, run) {
            Some(run) => {
                std::thread::spawn(|| {
                    std::thread::sleep(PATIENCE);
                    eprintln!("no end within {PATIENCE:?}");
                    std::process::exit(3);
                });
                run();
                ExitCode::SUCCESS
            }
            None => {
                eprintln!("no run `{run}` of a variant `{variant}`");
                ExitCode::from(2)
            }
        },
        _ => {
            eprintln!("say a variant and a run, or nothing for all");
            ExitCode::from(2)
        }
    }
}

fn find(variant: &str, run: &str) -> Option<fn()> {
    let whole = REAL.iter().filter(|(name, _)| *name == variant).flat_map(|(_, runs)| *runs);
    let broken = BROKEN.iter().filter(|(name, ..)| *name == variant).map(|(_, name, run)| (name, run));
    let mut all = whole.map(|(name, run)| (name, run)).chain(broken);
    all.find(|(name, _)| **name == run).map(|(_, run)| *run)
}

fn validate() -> ExitCode {
    let mut wrong = 0;
    for (real, run) in REAL.iter().flat_map(|(real, runs)| runs.iter().map(move |(run, _)| (real, run))) {
        let ended = process(real, run);
        let clean = ended.0.status.success() && !is_race(&ended.0);
        report(clean, &format!("{run}: nothing to report"), &ended, &mut wrong);
    }
    for (variant, run, _) in BROKEN {
        let ended = process(variant, run);
        report(is_race(&ended.0), &format!("{variant}: {run} shows a data race"), &ended, &mut wrong);
    }
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn report(good: bool, promise: &str, (output, took): &(Output, Duration), wrong: &mut u32) {
    if good {
        println!("ok   {promise} ({:.1} s)", took.as_secs_f64());
    } else {
        *wrong += 1;
        println!("FAIL {promise}; instead: {}\n{}", output.status, String::from_utf8_lossy(&output.stderr));
    }
}

/// Not any report will do: it must be about two threads in one body, or in one record (`stream_rig.rs`).
fn is_race(output: &Output) -> bool {
    let text = String::from_utf8_lossy(&output.stderr);
    text.contains("WARNING: ThreadSanitizer: data race") && text.contains("rig.rs")
}

fn process(variant: &str, run: &str) -> (Output, Duration) {
    let began = Instant::now();
    let mut command = Command::new(std::env::current_exe().unwrap_or_else(|error| panic!("this program: {error}")));
    // The first report ends it: what comes after follows from it.
    command.args([variant, run]).env("TSAN_OPTIONS", "halt_on_error=1 exitcode=66 atexit_sleep_ms=0");
    let output = command.output().unwrap_or_else(|error| panic!("cannot start a run: {error}"));
    (output, began.elapsed())
}

#[cfg(test)]
mod tests {
    /// Without ThreadSanitizer, and few times: torn bodies and false accounts would show all the same.
    #[test]
    fn every_run_ends_and_is_accounted() {
        super::REAL.iter().flat_map(|(_, runs)| *runs).for_each(|(_, run)| run());
    }
}
