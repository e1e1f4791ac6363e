//! Runs one hot path some thousand times, for `cargo xtask instructions`, which runs this under callgrind.
//!
//! A program without arguments prints the names of its paths. `PATH TIMES` runs one: callgrind counts what happens
//! inside [`counted`] and nothing else, so neither the preparation of an operation nor the first operations count.

use std::process::ExitCode;

/// Operations before those that count: rows are claimed, keys derived, lists filled by then.
const WARM_UP: usize = 200;

/// A hot path, ready to be run.
pub(super) trait Path {
    /// Brings about what the next operation needs.
    fn prepare(&mut self) {}

    /// The operation.
    fn operate(&mut self);

    /// Clears away what the operation left.
    fn finish(&mut self) {}
}

/// A name, and how its path begins.
pub(super) type Entry = (&'static str, fn() -> Box<dyn Path>);

/// The whole program.
pub(super) fn run(paths: &[Entry]) -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [asked, times] = arguments.as_slice() else {
        paths.iter().for_each(|(name, _)| println!("{name}"));
        return ExitCode::SUCCESS;
    };
    let Some((_, begin)) = paths.iter().find(|(name, _)| name == asked) else {
        eprintln!("no path {asked}");
        return ExitCode::FAILURE;
    };
    let (mut path, times) = (begin(), times.parse::<usize>().unwrap());
    for number in 0..WARM_UP + times {
        path.prepare();
        if number < WARM_UP {
            path.operate()
        } else {
            counted(path.as_mut())
        }
        path.finish();
    }
    ExitCode::SUCCESS
}

/// What callgrind counts, by this name.
#[inline(never)]
fn counted(path: &mut dyn Path) {
    path.operate();
}
