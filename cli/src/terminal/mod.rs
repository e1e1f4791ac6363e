//! The command's output at the terminal.

pub(crate) mod habits;
pub(crate) mod parser;
pub(crate) mod raw;
pub(crate) mod speech;
pub(crate) mod table;
pub(crate) mod units;
pub(crate) mod whole_file;

use rohrpost::output::plain::{self, Lines};
use std::io::{IsTerminal, Write};

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

/// Width of the terminal that reads the output, characters. None: a file or another program reads it, which gets whole
/// lines.
pub(crate) fn columns() -> Option<usize> {
    let output = std::io::stdout();
    let (width, _) = output.is_terminal().then(|| terminal_size::terminal_size_of(&output))??;
    Some(usize::from(width.0)).filter(|columns| *columns > 0)
}

/// Height of the terminal that reads the output, lines; as [`columns`].
pub(crate) fn rows() -> Option<usize> {
    let output = std::io::stdout();
    let (_, height) = output.is_terminal().then(|| terminal_size::terminal_size_of(&output))??;
    Some(usize::from(height.0)).filter(|rows| *rows > 0)
}

/// Prints prose: on a terminal, long lines are broken at blanks.
pub(crate) fn say_folded(text: impl std::fmt::Display) -> bool {
    say(folded(&text.to_string(), columns()))
}

/// Prose for a terminal of this width, or as it is.
pub(crate) fn folded(text: &str, columns: Option<usize>) -> String {
    let Some(columns) = columns else { return text.into() };
    text.lines().flat_map(|line| wrap(line, columns)).collect::<Vec<_>>().join("\n")
}

/// A line in pieces of at most this many characters, broken at blanks where possible; the later pieces are indented
/// like the line itself, and a little more.
pub(crate) fn wrap(text: &str, width: usize) -> Vec<String> {
    // A module may print anything; on the screen a line stays one line.
    let text = plain::line(text);
    let indent = (text.chars().take_while(|letter| *letter == ' ').count() + 2).min(width / 3);
    let mut pieces = Vec::new();
    let mut rest: Vec<char> = text.trim_end().chars().collect();
    let mut before = 0;
    while rest.len() + before > width && width > before {
        let room = width - before;
        let blank = rest[..=room.min(rest.len() - 1)].iter().rposition(|letter| *letter == ' ');
        // A blank in the indentation, or too far to the left, is no place to break.
        let at = blank.filter(|at| *at > room / 2).unwrap_or(room);
        let piece: String = rest.drain(..at).collect();
        pieces.push(" ".repeat(before) + piece.trim_end());
        let blanks = rest.iter().take_while(|letter| **letter == ' ').count();
        rest.drain(..blanks);
        before = indent;
    }
    if !rest.is_empty() || pieces.is_empty() {
        pieces.push(" ".repeat(before) + &rest.into_iter().collect::<String>());
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_broken_at_blanks_without_loss() {
        assert_eq!(wrap("one two three", 8), ["one two", "  three"]);
        assert_eq!(wrap("  one two three", 10), ["  one two", "   three"]);
        assert_eq!(wrap("abcdefghij", 4), ["abcd", " efg", " hij"]);
        assert_eq!(wrap("", 4), [""]);
        assert_eq!(wrap("a\u{1b}[31m\tb", 20), ["a\\u001b[31m\\tb"]);
        for width in 0..30 {
            for piece in wrap("  a rather long line with averyverylongwordinit and more", width) {
                assert!(piece.chars().count() <= width.max(56), "{width}: {piece:?}");
                assert!(width < 4 || piece.chars().count() <= width, "{width}: {piece:?}");
            }
        }
    }

    #[test]
    fn prose_keeps_its_lines_and_is_whole_without_a_terminal() {
        let text = "ok  a finding\n      its long reason, in words";
        assert_eq!(folded(text, None), text);
        assert_eq!(folded(text, Some(80)), text);
        assert_eq!(folded(text, Some(20)), "ok  a finding\n      its long\n      reason, in\n      words");
    }
}
