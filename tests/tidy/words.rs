//! Words that comments and messages do without, and the width of lines.

use std::path::Path;

/// Columns of a line.
const COLUMNS_MAX: usize = 120;

/// A word that is not the field's, and what to write.
const WORDS: &[(&[&str], &str)] = &[
    (&["who", "whose", "whom", "whoever", "whomever"], "a thing is \"it\" or \"that\"; put the subject first"),
    (&["face", "faces"], "alias"),
    (&["mend", "mends", "mended", "mending"], "fix"),
    (&["overtaken", "overtakes"], "reordered"),
    (&["acquaintance", "acquaintances", "acquainted"], "peer session"),
    (&["greets", "greeter", "greeting"], "handshake"),
    (&["reign", "reigns"], "term of a master"),
    (&["judge", "judges", "judged", "judging"], "validate, check"),
];

/// Files that quote such words: the table above itself.
const QUOTES: &[&str] = &["tests/tidy/words.rs"];

/// Files that quote lines of others, which may be wider there than where they come from.
const WIDE: &str = "tests/testbed/mistaken/src/catalog/";

/// What is wrong in a file: file, line, and what would be right.
pub(crate) fn mistakes(root: &Path, file: &Path) -> Vec<String> {
    let name = file.strip_prefix(root).unwrap().to_str().unwrap();
    let text = std::fs::read_to_string(file).unwrap();
    let mut mistakes = Vec::new();
    let mut found = |line: usize, what: String| mistakes.push(format!("{name}:{}: {what}", line + 1));
    for (index, line) in text.lines().enumerate() {
        let columns = line.chars().count();
        if columns > COLUMNS_MAX && !is_drawing(line) && !name.starts_with(WIDE) {
            found(index, format!("{columns} columns; {COLUMNS_MAX} are readable"));
        }
        if QUOTES.contains(&name) {
            continue;
        }
        // Names of functions are words with `_` between them.
        for word in line.split(|c: char| !c.is_alphabetic()).map(str::to_lowercase) {
            if let Some((_, instead)) = WORDS.iter().find(|(words, _)| words.contains(&word.as_str())) {
                found(index, format!("`{word}`: {instead}"));
            }
        }
    }
    mistakes
}

/// A row of a table, or a line of a picture, cannot be wrapped.
fn is_drawing(line: &str) -> bool {
    let comment = line.trim_start().trim_start_matches(['/', '!']).trim_start();
    line.trim_start().starts_with("//") && (comment.starts_with('|') || line.contains(['─', '▶', '═']))
}

#[test]
fn words_and_wide_lines_are_found_where_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bad.rs");
    let wide = "/".repeat(COLUMNS_MAX + 1);
    std::fs::write(&file, format!("// a whole line\nfn only_who_lives() {{}}\n{wide}\n// Mends it.\n")).unwrap();
    let found: Vec<String> =
        mistakes(folder.path(), &file).iter().map(|found| found.split(';').next().unwrap().to_owned()).collect();
    assert_eq!(
        found,
        ["bad.rs:2: `who`: a thing is \"it\" or \"that\"", "bad.rs:3: 121 columns", "bad.rs:4: `mends`: fix"]
    );
}
