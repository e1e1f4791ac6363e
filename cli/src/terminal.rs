//! What the command says to the person at the terminal.

use rohrpost::output::plain::Lines;
use std::io::Write;

/// What went wrong, in words for that person.
pub(crate) type Failure = Box<dyn std::error::Error>;

/// Prints a line, or several; false when nobody reads any more (a closed pipe is the reader's way to say enough). All that the command prints
/// goes through here and [`complain`], and so nothing that a terminal would obey: names, texts and faults are those of others.
pub(crate) fn say(line: impl std::fmt::Display) -> bool {
    writeln!(std::io::stdout(), "{}", Lines(line)).is_ok()
}

/// Prints a line, or several, to the standard error.
pub(crate) fn complain(line: impl std::fmt::Display) {
    // Who would read it may be gone.
    let _ = writeln!(std::io::stderr(), "{}", Lines(line));
}
