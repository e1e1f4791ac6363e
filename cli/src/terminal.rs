//! The command's output at the terminal.

use rohrpost::output::plain::Lines;
use std::io::Write;

/// An error message for the user.
pub(crate) type Failure = Box<dyn std::error::Error>;

/// Prints a line, or several; false when nobody reads any more (a closed pipe). All output of the command goes through
/// here and
/// [`complain`], which escape what a terminal would obey: names, texts and faults come from other programs.
pub(crate) fn say(line: impl std::fmt::Display) -> bool {
    writeln!(std::io::stdout(), "{}", Lines(line)).is_ok()
}

/// Prints a line, or several, to the standard error.
pub(crate) fn complain(line: impl std::fmt::Display) {
    // The reader may be gone.
    let _ = writeln!(std::io::stderr(), "{}", Lines(line));
}

/// Prints a line to the standard error in place of the one that was printed so before.
pub(crate) fn complain_in_place(line: impl std::fmt::Display) {
    let _ = write!(std::io::stderr(), "\r\x1b[K{}", Lines(line));
}
