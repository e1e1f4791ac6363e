//! Texts of the screen: dates, long lines, the help.

use super::super::table;
use super::columns::{Column, short};
use super::model::{Model, TimeNow};
use rohrpost::output::plain;
use rohrpost::survey::Standing;
use rohrpost_builtin::format::iso;

/// A moment to the second, such as `2026-11-21 10:40:12 UTC`.
pub(super) fn date(time_ns: u64) -> String {
    let text = iso(time_ns).replace('T', " ");
    format!("{} UTC", text.split('.').next().unwrap_or_default())
}

/// A line in pieces of at most this many characters, broken at blanks where possible; the later pieces are indented
/// like the line itself, and a little more.
pub(super) fn wrap(text: &str, width: usize) -> Vec<String> {
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

/// The whole output as plain text, for `--once`.
pub(super) fn table(model: &Model) -> String {
    let several = model.nodes.len() > 1;
    let columns = || Column::ALL.into_iter().filter(|column| several || *column != Column::Node);
    let heads = columns().map(|column| format!("{}{}", if column.is_number() { ">" } else { "" }, column.head()));
    let heads: Vec<String> = heads.collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let rows = model.modules.iter().map(|row| columns().map(|column| column.cell(row)).collect::<Vec<_>>());
    let table = table::table_of(&heads, rows);
    format!("{}\n\n{}", head(model).join("\n"), table.trim_end())
}

/// The two lines above the table.
pub(super) fn head(model: &Model) -> [String; 2] {
    let whole = match model.nodes.len() {
        1 => format!("{}.{}", model.installation, model.nodes[0]),
        several => format!("{}: {several} nodes", model.installation),
    };
    let TimeNow { time_ns, time_source, time_pace, time_known } = model.time;
    let date = if time_known { date(time_ns) } else { "no time yet".into() };
    let pace = if time_pace == 1.0 || !time_known { String::new() } else { format!(" x {time_pace}") };
    let mut first = vec![whole, date, format!("{time_source}{pace}")];
    if !model.launched {
        first.push("NOT LAUNCHED".into());
    }
    first.extend(model.silent.iter().map(|silence| format!("{} {}", silence.node, silence.since().to_uppercase())));
    let mut states: Vec<(&&str, &usize)> = model.states.iter().collect();
    states.sort_by_key(|(state, _)| Standing::WORDS.iter().position(|word| word == *state));
    let states: Vec<String> = states.iter().map(|(state, count)| format!("{count} {state}")).collect();
    let number = |number: Option<f64>| number.map_or("-".into(), short);
    let mut second = vec![
        format!("{} modules: {}", model.modules.len(), states.join(", ")),
        format!("{} packages/s", number(model.received_per_s)),
        format!("{} lost", model.losses.lost),
    ];
    if model.losses.lost > 0 {
        second.push(format!("{} lost/s", number(model.lost_per_s)));
    }
    [first.join("   "), second.join("   ")]
}

const KEYS: [(&str, &str); 12] = [
    ("arrows, j k", "select a module; g and G the first and the last"),
    ("Enter", "details of the module; Esc goes back"),
    ("o", "switch it on"),
    ("f", "switch it off: its safe state"),
    ("r", "restart it, after y"),
    ("s", "sort by the next column, S the other way round"),
    ("/", "only modules with the typed text in their name; Esc: all"),
    ("l", "output of the selected module only, or of all"),
    ("L", "lowest level of output: info, debug, trace, error, warn"),
    ("p", "pause: the screen stays as it is; p goes on"),
    ("?", "this help"),
    ("q, Ctrl-C", "end"),
];

const WHAT: &str = "  Rates and waiting times are those of the last interval. They are read from shared memory, which \
    disturbs nobody; launches of other nodes report theirs. The collector of output is asked for new lines once an \
    interval.";

/// All keys and all columns.
pub(super) fn help() -> Vec<String> {
    let mut lines = vec!["keys".into()];
    lines.extend(KEYS.iter().map(|(key, text)| format!("  {key:<12} {text}")));
    lines.extend(["".into(), "columns; narrow terminals have fewer".into()]);
    lines.extend(Column::ALL.iter().map(|column| format!("  {:<12} {}", column.head(), column.text())));
    lines.extend(["".into(), "contents".into(), WHAT.into()]);
    lines
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
}
