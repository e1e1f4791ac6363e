//! Texts of others in comments and literals of code. None ends its comment or literal, begins a line, or changes the
//! direction in which the code is read.

use rohrpost::output::plain::is_obeyed;
use rohrpost::schema::{Field, Value};

/// Columns of a line of comment, with its indentation.
const COLUMNS: usize = 100;

/// One line: what separates words is one space, and what a terminal or an editor obeys is left out.
pub(super) fn one_line(text: &str) -> String {
    let spaced: String = text.chars().map(|c| if c.is_whitespace() || is_obeyed(c) { ' ' } else { c }).collect();
    spaced.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What is known of a value besides its type: its text, its range and its unit.
pub(super) fn of_field(field: &Field) -> String {
    let text = one_line(&field.text);
    let range = field.range().map(|range| one_line(&range));
    let unit = Some(one_line(&field.unit)).filter(|unit| !unit.is_empty());
    let numbers = [range, unit].into_iter().flatten().collect::<Vec<_>>().join(" ");
    match (text.is_empty(), numbers.is_empty()) {
        (_, true) => text,
        (true, false) => format!("{numbers}."),
        (false, false) => format!("{text} ({numbers})"),
    }
}

/// The lines of a text, each behind `prefix`; none of an empty one. A longer word has a line of its own.
pub(super) fn wrapped(prefix: &str, text: &str) -> String {
    let mut lines = String::new();
    let mut line = String::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        let columns = prefix.chars().count() + line.chars().count() + 1 + word.chars().count();
        if !line.is_empty() && columns > COLUMNS {
            lines += &format!("{prefix}{line}\n");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    if !line.is_empty() {
        lines += &format!("{prefix}{line}\n");
    }
    lines
}

/// A bound in Rust and Python; those that are no numbers stay away.
pub(super) fn literal(value: &Value) -> Option<String> {
    match value {
        Value::U(number) => Some(number.to_string()),
        Value::I(number) => Some(number.to_string()),
        Value::F(number) if number.is_finite() => Some(format!("{number:?}")),
        _ => None,
    }
}

/// A literal of Python: escapes of JSON, which Python reads alike but for halves of pairs.
pub(super) fn python_literal(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => literal.extend(['\\', c]),
            '\n' => literal += "\\n",
            c if is_obeyed(c) || (!c.is_ascii() && !c.is_alphanumeric() && !is_plain_sign(c)) => {
                literal += &format!("\\U{:08x}", u32::from(c));
            }
            c => literal.push(c),
        }
    }
    literal + "\""
}

/// Signs beyond ASCII that units and texts have, and that nobody mistakes.
fn is_plain_sign(c: char) -> bool {
    "°µ²³·×÷…–—’“”„‚«»€§".contains(c)
}

/// A literal of C: what is not plain ASCII is written by its bytes, in octal, which no digit behind them changes.
pub(super) fn c_literal(text: &str) -> String {
    let mut literal = String::from("\"");
    for byte in text.bytes() {
        match byte {
            b'"' | b'\\' | b'?' => literal.extend(['\\', char::from(byte)]),
            b' '..=b'~' => literal.push(char::from(byte)),
            other => literal += &format!("\\{other:03o}"),
        }
    }
    literal + "\""
}

/// A text in a comment of C: neither ends nor begins one, and has no trigraph and no spliced line.
pub(super) fn in_c_comment(text: &str) -> String {
    let mut line = one_line(text);
    // The sign that may become a part of the others is the first to go.
    for (bad, good) in [("\\", "/"), ("*/", "* /"), ("/*", "/ *"), ("??", "? ?")] {
        // More than once: of `???` one is left. Each turn puts a space between.
        while line.contains(bad) {
            line = line.replace(bad, good);
        }
    }
    line
}

/// A comment of C before what it is of; nothing without a text.
pub(super) fn c_comment(indent: &str, text: &str) -> String {
    let lines = wrapped(&format!("{indent} * "), &in_c_comment(text));
    let Some(lines) = lines.strip_prefix(&format!("{indent} * ")) else { return String::new() };
    format!("{indent}/** {} */\n", lines.trim_end())
}

/// A text in a docstring of Python: it does not end, and has no line that `doctest` would run.
pub(super) fn in_docstring(text: &str) -> String {
    one_line(text).replace('\\', "\\\\").replace('"', "\\\"").replace(">>>", ">> >")
}

/// A text in a comment that rustdoc reads: no fence, behind which would stand code that tests run, and no HTML.
pub(super) fn in_rust_doc(text: &str) -> String {
    let line = one_line(text).replace("```", "`` `").replace("~~~", "~~ ~");
    let mut broken = String::with_capacity(line.len());
    for (at, c) in line.char_indices() {
        broken.push(c);
        if c == '<' && line[at + 1..].starts_with(|next: char| next.is_ascii_alphabetic() || "/!?".contains(next)) {
            broken.push(' ');
        }
    }
    broken
}
