//! Copies the mailbox's sources, plants the mistakes of the catalogue in the copy, and copies the scenes, for
//! `tests/mistaken`.

#[path = "tests/mistaken/catalog.rs"]
mod catalog;

use catalog::MISTAKES;
use rohrpost_planted::{Mistaken, without_inner_lines};

fn main() {
    Mistaken {
        sources: "../../src",
        tests: "tests/crash",
        started: "victim.rs",
        catalog: "tests/mistaken/catalog.rs",
        mistakes: MISTAKES,
        finish: finished,
    }
    .write();
}

/// A file of the mailbox without its unit tests.
fn finished(file: &str, mut text: String) -> String {
    if file == "lib.rs" {
        text = without_inner_lines(&text).replace("mod causes;", "#[macro_use]\nmod causes;");
    }
    // Within one file an exported macro has no path.
    let text = text.replace("#[macro_export]\n", "").replace("crate::causes!", "causes!");
    text.replace("#[cfg(test)]", "#[cfg(any())]")
}
