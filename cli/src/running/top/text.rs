//! Texts of the screen: dates, long lines, the help.

use super::columns::{Column, short};
use super::model::{Model, TimeNow};
use crate::terminal::table;
use crate::terminal::units::date;
use rohrpost_launch::survey::Standing;
use rohrpost_modules::runtime::clock_was_set;

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
    let TimeNow { time_ns, time_source, time_pace, time_known, clock_set_by_ns } = model.time;
    let date = if time_known { date(time_ns) } else { "no time yet".into() };
    let pace = if time_pace == 1.0 || !time_known { String::new() } else { format!(" x {time_pace}") };
    let mut first = vec![whole, date, format!("{time_source}{pace}")];
    if let Some(by_ns) = clock_set_by_ns {
        first.push(clock_was_set(by_ns).replace("this computer's clock is", "CLOCK"));
    }
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

const KEYS: [(&str, &str); 13] = [
    ("arrows, j k", "select a module; g and G the first and the last"),
    ("Enter", "details of the module; Esc goes back"),
    ("o", "switch it on"),
    ("f", "switch it off: its safe state"),
    ("r", "restart it, after y"),
    ("m", "map: walls seen, the way, the scan; Esc goes back"),
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
