//! Rows as people read them, and as programs do: one JSON object a line.

use crate::environment::Environment;
use crate::rounds::{Row, Target};
use crate::statistics::Ratio;
use comfy_table::{CellAlignment, Table, presets};
use serde_json::{Value, json};

/// The rows of one case, for people.
pub fn human(rows: &[Row]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header([
        "case", "bytes", "who", "p50", "p99", "p99.9", "max", "unit", "beside", "p50", "(rounds)", "p99", "target", "",
    ]);
    for row in rows {
        table.add_row(line(row));
    }
    for numbers in [1, 3, 4, 5, 6, 9, 11] {
        if let Some(column) = table.column_mut(numbers) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.to_string()
}

fn line(row: &Row) -> Vec<String> {
    let bytes = row.bytes.map(|bytes| bytes.to_string()).unwrap_or_default();
    let mut line = vec![row.case.clone(), bytes, row.who.to_string()];
    match &row.result {
        Ok(summary) => {
            let figures = [Some(summary.p50), summary.p99, summary.p999, summary.max];
            line.extend(figures.map(|figure| figure.map(number).unwrap_or_default()));
            line.push(row.unit.to_string());
        }
        Err(failure) => {
            line.extend([failure.to_string()]);
            line.extend([const { String::new() }; 4]);
        }
    }
    let Some(versus) = row.versus else { return line };
    let spread = row.ratio_p50.map(|ratio| format!("{:.2}..{:.2}", ratio.min, ratio.max));
    let ratio = |ratio: Option<Ratio>| ratio.map(|ratio| format!("{:.2}", ratio.median)).unwrap_or_default();
    let target = |name: &str, target: Option<Target>| {
        target.map(|target| match target {
            Target::AtMost(bound) => format!("{name} ≤ {bound}"),
            Target::AtLeast(bound) => format!("{name} ≥ {bound}"),
        })
    };
    let targets: Vec<String> = [target("p50", versus.p50), target("p99", versus.p99)].into_iter().flatten().collect();
    let met = row.met().map(|met| if met { "met" } else { "MISSED" }).unwrap_or_default();
    line.extend([versus.name.to_string(), ratio(row.ratio_p50), spread.unwrap_or_default(), ratio(row.ratio_p99)]);
    line.extend([targets.join(", "), met.to_string()]);
    line
}

/// Three digits that count.
fn number(value: f64) -> String {
    match value.abs() {
        0.0..10.0 => format!("{value:.3}"),
        10.0..100.0 => format!("{value:.2}"),
        100.0..1000.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// A row as one JSON object. What does not apply is null.
pub fn json(row: &Row) -> Value {
    let summary = row.result.as_ref().ok();
    let versus = row.versus.as_ref();
    let bound = |target: Option<Target>| target.map(Target::bound);
    json!({
        "case": row.case,
        "bytes": row.bytes,
        "unit": row.unit,
        "p50": summary.map(|summary| summary.p50),
        "p99": summary.and_then(|summary| summary.p99),
        "p999": summary.and_then(|summary| summary.p999),
        "max": summary.and_then(|summary| summary.max),
        "vs": versus.map(|versus| versus.name),
        "ratio_p50": row.ratio_p50.map(|ratio| ratio.median),
        "ratio_p99": row.ratio_p99.map(|ratio| ratio.median),
        "target_p50": versus.and_then(|versus| bound(versus.p50)),
        "target_p99": versus.and_then(|versus| bound(versus.p99)),
        "met": row.met(),
        "who": row.who,
        "ratio_p50_min": row.ratio_p50.map(|ratio| ratio.min),
        "ratio_p50_max": row.ratio_p50.map(|ratio| ratio.max),
        "note": row.result.as_ref().err().map(ToString::to_string),
    })
}

/// Where it was measured, for people.
pub fn human_environment(environment: &Environment) -> String {
    let Environment { processor, processors, kernel, load, refusals } = environment;
    let granted = match refusals.as_slice() {
        [] => "pinned to processors 0 and 1, SCHED_FIFO 50, memory locked".to_string(),
        refusals => format!(
            "REFUSED: {}; what follows is measured without, and its tails are other programs' work",
            refusals.join("; ")
        ),
    };
    format!(
        "processor  {processor}, {processors} of them\nkernel     {kernel}\nload       {load}\nscheduler  {granted}"
    )
}

/// Where it was measured, as the first JSON object.
pub fn json_environment(environment: &Environment) -> Value {
    json!({
        "case": "environment",
        "processor": environment.processor,
        "processors": environment.processors,
        "kernel": environment.kernel,
        "load": environment.load,
        "refused": environment.refusals,
    })
}
