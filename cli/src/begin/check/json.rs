//! The output of `check` for programs.

use crate::look::resolved;
use rohrpost_config::{Errors, Installation, MissingProgram};
use serde_json::{Value, json};

/// A file with mistakes.
pub(super) fn errors(errors: &Errors) -> Value {
    let file = errors.path().display().to_string();
    let problems = errors.problems().iter();
    let problems: Vec<Value> =
        problems.map(|problem| json!({ "file": file, "line": problem.line, "message": problem.message })).collect();
    json!({ "file": file, "right": false, "errors": problems })
}

/// A correct file, as `explain` describes it. `notes`: additional hints for people.
pub(super) fn installation(
    installation: &Installation,
    only: Option<&str>,
    missing: &[MissingProgram],
    notes: &[String],
) -> Value {
    let missing = missing.iter().map(|program| {
        let module = installation.classes.format(program.module);
        json!({ "module": module, "optional": program.optional, "message": program.message })
    });
    json!({
        "file": installation.path.display().to_string(),
        "right": true,
        "installation": resolved::of(installation, only),
        "missing_programs": missing.collect::<Vec<_>>(),
        "notes": notes,
    })
}
