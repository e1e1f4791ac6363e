//! What tests have not tested, and what they repeated: they write it to a file (see `tests/report`), a run shows it
//! last and fails if it is more than the repository allows.

use crate::cargo;
use crate::failure::Failure;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What may be skipped: a line for each, the reason that the test gives.
const ALLOWED: &str = "tests/skipped.txt";
/// A computer that stands still so often is none to run tests on.
const REPEATED_MAX: usize = 10;

/// The file of a run.
pub(crate) fn path() -> PathBuf {
    cargo::target().join("test-report.txt")
}

pub(crate) fn begin() -> Result<(), Failure> {
    fs::create_dir_all(cargo::target())
        .and_then(|()| fs::write(path(), ""))
        .map_err(|error| format!("{}: {error}", path().display()))
}

/// What is to be shown, and whether it is more than is allowed.
pub(crate) fn end() -> (String, Result<(), Failure>) {
    let read = |path: &Path| fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()));
    match (read(&path()), read(&cargo::root().join(ALLOWED))) {
        (Ok(report), Ok(allowed)) => told(&report, &allowed),
        (Err(failure), _) | (_, Err(failure)) => (String::new(), Err(failure)),
    }
}

fn told(report: &str, allowed: &str) -> (String, Result<(), Failure>) {
    let allowed: Vec<_> = allowed.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).collect();
    let mut lines: BTreeMap<&str, usize> = BTreeMap::new();
    report.lines().for_each(|line| *lines.entry(line).or_default() += 1);
    let (mut skipped, mut repeated, mut refused, mut text) = (0, 0, 0, String::new());
    for (line, times) in lines {
        let Some((kind, rest)) = line.split_once('\t') else { continue };
        let (place, reason) = rest.split_once('\t').unwrap_or((rest, ""));
        let (is_repeated, is_allowed) = (kind == "repeated", allowed.contains(&reason));
        *if is_repeated { &mut repeated } else { &mut skipped } += times;
        refused += if is_repeated || is_allowed { 0 } else { times };
        let note = if is_allowed && !is_repeated { ", as tests/skipped.txt allows" } else { "" };
        let times = if times > 1 { format!(" ({times} times)") } else { String::new() };
        text += &format!("    {}{times}, {place}: {reason}{note}\n", kind.to_uppercase());
    }
    let head = format!("    {skipped} skipped, {repeated} repeated (at most {REPEATED_MAX})\n");
    let result = if refused > 0 {
        Err(format!(
            "{refused} skipped that {ALLOWED} does not allow: install what they name, or run where it is allowed"
        ))
    } else if repeated > REPEATED_MAX {
        Err(format!(
            "{repeated} tests were repeated, at most {REPEATED_MAX} may be: this computer stands still too often"
        ))
    } else {
        Ok(())
    };
    (head + &text, result)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALLOWED: &str = "# Why.\nno such kernel\n";

    #[test]
    fn nothing_to_report_is_well() {
        assert_eq!(told("", ALLOWED), ("    0 skipped, 0 repeated (at most 10)\n".to_owned(), Ok(())));
    }

    #[test]
    fn what_is_skipped_must_be_allowed() {
        let (text, result) = told("skipped\ta.rs:1\tno such kernel\n", ALLOWED);
        assert!(
            text.contains("SKIPPED, a.rs:1: no such kernel, as tests/skipped.txt allows\n") && result.is_ok(),
            "{text}"
        );
        let (text, result) = told("skipped\ta.rs:1\tno tshark\nskipped\ta.rs:1\tno tshark\n", ALLOWED);
        assert!(
            text.starts_with("    2 skipped, 0 repeated") && text.contains("SKIPPED (2 times), a.rs:1: no tshark\n")
        );
        assert!(result.is_err_and(|failure| failure.starts_with("2 skipped that tests/skipped.txt does not allow")));
    }

    #[test]
    fn repetitions_are_counted_and_limited() {
        let many = |times: usize| (0..times).map(|at| format!("repeated\tb.rs:{at}\tlate\n")).collect::<String>();
        assert!(told(&many(REPEATED_MAX), ALLOWED).1.is_ok());
        assert!(told(&many(REPEATED_MAX + 1), ALLOWED).1.is_err());
    }
}
