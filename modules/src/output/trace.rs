//! Which lines of a back trace are printed: those of the module's own code. What lies above them is how a panic is
//! raised, what lies below how a program and this runtime begin; both are the same each time.

use std::path::Path;

/// Lines that are printed at most.
pub const LINES_MAX: usize = 40;
/// How names of functions begin that are nobody's own.
const OTHERS: [&str; 17] = [
    "std::",
    "<std::",
    "core::",
    "<core::",
    "alloc::",
    "<alloc::",
    "test::",
    "__",
    "_start",
    "rust_begin_unwind",
    "rust_panic",
    "rohrpost_modules::",
    "<rohrpost_modules::",
    "rohrpost_launch::",
    "<rohrpost_launch::",
    "<unknown>",
    "start_thread",
];
/// In paths of sources that are nobody's own: the standard library's, and those of packages that were fetched.
const FOREIGN: [&str; 3] = ["/rustc/", "/rustlib/src/", "/registry/src/"];

/// The frames of a back trace that are worth a look, at most [`LINES_MAX`] lines of them; all frames where `all` is
/// wished.
pub(super) fn lines(trace: &str, all: bool) -> Vec<&str> {
    let folder = std::env::current_dir().unwrap_or_default();
    let mut shown = Vec::new();
    let mut rest = trace.lines().peekable();
    while let Some(line) = rest.next() {
        let Some(function) = function(line) else { continue };
        // Below it stands where that is, if the program knows it.
        let at = rest.next_if(|line| place(line).is_some());
        let is_own = !OTHERS.iter().any(|begin| function.starts_with(begin))
            && at.and_then(place).is_none_or(|path| is_own_file(path, &folder));
        if all || is_own {
            shown.extend([Some(line), at].into_iter().flatten());
        }
    }
    shown.truncate(LINES_MAX);
    shown
}

/// The name of a function, in the line that begins a frame: `  12: name`.
fn function(line: &str) -> Option<&str> {
    let (number, name) = line.trim_start().split_once(": ")?;
    number.bytes().all(|byte| byte.is_ascii_digit()).then_some(name)
}

/// The path in `at PATH:LINE:COLUMN`.
fn place(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix("at ")
}

/// Inlined functions have no folder in their names, only in their paths.
fn is_own_file(path: &str, folder: &Path) -> bool {
    let path = path.strip_prefix("./").map_or_else(|| path.to_owned(), |path| folder.join(path).display().to_string());
    !FOREIGN.iter().any(|foreign| path.contains(foreign))
        && !path.starts_with(concat!(env!("CARGO_MANIFEST_DIR"), "/src/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As of a build without optimisation; two of its functions were inlined.
    const TRACE: &str = "   0: std::backtrace_rs::backtrace::trace
             at /rustc/1/library/std/src/../../backtrace/src/backtrace/mod.rs:66:14
   1: rohrpost_modules::output::layer::listen_for_panics::{{closure}}
             at ./modules/src/output/layer.rs:40:21
   2: core::panicking::panic_fmt
             at /rustc/1/library/core/src/panicking.rs:75:14
   3: compass::Compass::turn
             at ./compass/src/main.rs:30:9
   4: core::ops::function::FnOnce::call_once
   5: <compass::Compass as rohrpost_modules::module::Module>::tick
             at ./compass/src/main.rs:24:9
   6: rohrpost_modules::runtime::runner::Life<M>::work
             at ./modules/src/runtime/runner.rs:99:22
   7: compass::main
             at ./compass/src/main.rs:50:5
   8: call_once<fn(), ()>
             at /rustc/1/library/core/src/ops/function.rs:250:5
   9: go<compass::Compass>
             at SELF/src/runtime/runner.rs:215:33
  10: turn_more
             at ./compass/src/main.rs:35:9
  11: __libc_start_call_main
";

    #[test]
    fn of_a_trace_the_own_frames_are_shown() {
        let trace = TRACE.replace("SELF", env!("CARGO_MANIFEST_DIR"));
        let shown: Vec<&str> = lines(&trace, false).into_iter().map(str::trim).collect();
        let own = [
            "3: compass::Compass::turn",
            "at ./compass/src/main.rs:30:9",
            "5: <compass::Compass as rohrpost_modules::module::Module>::tick",
            "at ./compass/src/main.rs:24:9",
            "7: compass::main",
            "at ./compass/src/main.rs:50:5",
            "10: turn_more",
            "at ./compass/src/main.rs:35:9",
        ];
        assert_eq!(shown, own);
        assert_eq!(lines(&trace, true).len(), trace.lines().count());
    }
}
