//! Rows as people read them, and as programs do: one JSON object a line.

use crate::environment::Environment;
use crate::harness::Failure;
use crate::rounds::{Row, Target};
use crate::statistics::Ratio;
use comfy_table::{CellAlignment, ColumnConstraint, Table, Width, presets};
use serde::Serialize;

/// Columns and their minimum widths, so that the tables of all cases align.
const COLUMNS: [(&str, u16, CellAlignment); 14] = [
    ("case", 27, CellAlignment::Left),
    ("bytes", 6, CellAlignment::Right),
    ("contender", 20, CellAlignment::Left),
    ("p50", 6, CellAlignment::Right),
    ("p99", 6, CellAlignment::Right),
    ("p99.9", 6, CellAlignment::Right),
    ("max", 6, CellAlignment::Right),
    ("unit", 4, CellAlignment::Left),
    ("beside", 20, CellAlignment::Left),
    ("p50", 5, CellAlignment::Right),
    ("(rounds)", 12, CellAlignment::Right),
    ("p99", 5, CellAlignment::Right),
    ("target", 24, CellAlignment::Left),
    ("", 6, CellAlignment::Left),
];

/// The rows of one case, for people; below them the reasons for missing figures.
pub fn human(rows: &[Row]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(COLUMNS.map(|(name, ..)| name));
    for row in rows {
        table.add_row(line(row));
    }
    for (column, (_, width, alignment)) in table.column_iter_mut().zip(COLUMNS) {
        // On both sides there is a blank.
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width + 2)));
        column.set_cell_alignment(alignment);
    }
    let mut text: String = table.lines().map(|line| format!("{}\n", line.trim_end())).collect();
    let mut said = Vec::new();
    for row in rows {
        if let Err(failure) = &row.result
            && !said.contains(&row.contender)
        {
            said.push(row.contender);
            text.push_str(&format!(" {}: {failure}\n", row.contender));
        }
    }
    text
}

fn line(row: &Row) -> Vec<String> {
    let bytes = row.bytes.map(|bytes| bytes.to_string()).unwrap_or_default();
    let mut line = vec![row.case.clone(), bytes, row.contender.to_string()];
    match &row.result {
        Ok(summary) => {
            let figures = [Some(summary.p50), summary.p99, summary.p999, summary.max];
            line.extend(figures.map(|figure| figure.map(number).unwrap_or_default()));
            line.push(row.unit.to_string());
        }
        Err(failure) => {
            let word = if matches!(failure, Failure::Skipped(_)) { "skipped" } else { "FAILED" };
            line.extend([word, "", "", "", ""].map(String::from));
        }
    }
    let Some(versus) = row.versus else { return line };
    let spread = row.ratio_p50.map(|ratio| format!("{:.2}..{:.2}", ratio.min, ratio.max));
    let ratio = |ratio: Option<Ratio>| ratio.map(|ratio| format!("{:.2}", ratio.median)).unwrap_or_default();
    let target = |name: &str, target: Option<Target>| {
        target.map(|target| match target {
            Target::AtMost(bound) => format!("{name} ≤ {bound}"),
            Target::EachAtMost(bound) => format!("each {name} ≤ {bound}"),
            Target::AtLeast(bound) => format!("{name} ≥ {bound}"),
        })
    };
    let targets: Vec<String> = [target("p50", versus.p50), target("p99", versus.p99)].into_iter().flatten().collect();
    let met = row.met().map(|met| if met { "met" } else { "MISSED" }).unwrap_or_default();
    line.extend([versus.name.to_string(), ratio(row.ratio_p50), spread.unwrap_or_default(), ratio(row.ratio_p99)]);
    line.extend([targets.join(", "), met.to_string()]);
    line
}

/// Three significant digits.
fn number(value: f64) -> String {
    match value.abs() {
        0.0..10.0 => format!("{value:.3}"),
        10.0..100.0 => format!("{value:.2}"),
        100.0..1000.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// A row as JSON. What does not apply is null.
#[derive(Serialize)]
struct JsonRow<'a> {
    case: &'a str,
    bytes: Option<usize>,
    unit: &'a str,
    p50: Option<f64>,
    p99: Option<f64>,
    p999: Option<f64>,
    max: Option<f64>,
    vs: Option<&'a str>,
    ratio_p50: Option<f64>,
    ratio_p99: Option<f64>,
    target_p50: Option<f64>,
    target_p99: Option<f64>,
    met: Option<bool>,
    contender: &'a str,
    ratio_p50_min: Option<f64>,
    ratio_p50_max: Option<f64>,
    /// Why there are no figures.
    note: Option<String>,
}

/// A row as one JSON object on one line.
pub fn json(row: &Row) -> String {
    let summary = row.result.as_ref().ok();
    let versus = row.versus.as_ref();
    let row = JsonRow {
        case: &row.case,
        bytes: row.bytes,
        unit: row.unit,
        p50: summary.map(|summary| summary.p50),
        p99: summary.and_then(|summary| summary.p99),
        p999: summary.and_then(|summary| summary.p999),
        max: summary.and_then(|summary| summary.max),
        vs: versus.map(|versus| versus.name),
        ratio_p50: row.ratio_p50.map(|ratio| ratio.median),
        ratio_p99: row.ratio_p99.map(|ratio| ratio.median),
        target_p50: versus.and_then(|versus| versus.p50).map(Target::bound),
        target_p99: versus.and_then(|versus| versus.p99).map(Target::bound),
        met: row.met(),
        contender: row.contender,
        ratio_p50_min: row.ratio_p50.map(|ratio| ratio.min),
        ratio_p50_max: row.ratio_p50.map(|ratio| ratio.max),
        note: row.result.as_ref().err().map(ToString::to_string),
    };
    object(&row)
}

fn object(value: &impl Serialize) -> String {
    // Strings and numbers under names: nothing in it can fail.
    serde_json::to_string(value).unwrap_or_default()
}

/// Where it was measured, for people.
pub fn human_environment(environment: &Environment) -> String {
    let Environment { processor, processors, kernel, load, refusals, versions } = environment;
    let count = processors.len();
    let pair = processors.iter().take(2).map(ToString::to_string).collect::<Vec<_>>().join(" and ");
    let granted = match refusals.as_slice() {
        [] => format!("granted: processors {pair}, SCHED_FIFO 50, locked memory"),
        refusals => format!(
            "REFUSED: {}; what follows is measured without, and its tails are other programs' work",
            refusals.join("; ")
        ),
    };
    let versions: String = versions.iter().map(|version| format!("\nversion    {version}")).collect();
    let head = format!("processor  {processor}, {count} of them\nkernel     {kernel}\nload       {load}");
    format!("{head}\nscheduler  {granted}{versions}")
}

/// Where it was measured: the first JSON object.
pub fn json_environment(environment: &Environment) -> String {
    object(&Tagged { case: "environment", rest: environment })
}

/// How busy the computer was when all was measured: the last JSON object.
pub fn json_load_afterwards(load: &str) -> String {
    #[derive(Serialize)]
    struct Load<'a> {
        load: &'a str,
    }
    object(&Tagged { case: "environment-after", rest: Load { load } })
}

/// An object with its kind, as rows have one.
#[derive(Serialize)]
struct Tagged<T> {
    case: &'static str,
    #[serde(flatten)]
    rest: T,
}
