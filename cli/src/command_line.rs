//! Commands in words, as one types them.

use rohrpost::output::plain;
use std::ffi::OsStr;

/// Words of a command in one line: quoted as a shell wants them, escaped as a terminal may have them.
pub(crate) fn command_line<W: AsRef<OsStr>>(words: impl IntoIterator<Item = W>) -> String {
    let words = words.into_iter().map(|word| quoted(&word.as_ref().to_string_lossy()));
    words.collect::<Vec<_>>().join(" ")
}

fn quoted(word: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || "@%+=:,./_-".contains(c);
    if !word.is_empty() && word.chars().all(is_bare) {
        return word.to_owned();
    }
    if word.contains(plain::is_obeyed) {
        // As bash reads it.
        return format!("$'{}'", plain::line(&word.replace('\\', r"\\").replace('\'', r"\'")));
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_word_is_one_and_none_of_them_moves_a_cursor() {
        for (words, line) in [
            (&["target/debug/pilot", "--port=/dev/ttyS0", "-v"][..], "target/debug/pilot --port=/dev/ttyS0 -v"),
            (&["/bin/sh", "-c", "rm -r ~; it's gone"], r"/bin/sh -c 'rm -r ~; it'\''s gone'"),
            (&["a", "", "$HOME", "ü"], "a '' '$HOME' 'ü'"),
            (&["x\nFORGED: it's\\ \u{1b}[2J\u{202e}"], r"$'x\nFORGED: it\'s\\ \u001b[2J\u202e'"),
        ] {
            assert_eq!(command_line(words), line);
        }
    }
}
