//! Copies fusion's sources, plants the mistakes of the catalogue in the copy, and copies the tests.

#[path = "src/catalog.rs"]
mod catalog;

use catalog::MISTAKES;
use rohrpost_planted::{Mistaken, without_inner_lines};

fn main() {
    Mistaken {
        sources: "../src",
        tests: "../tests/promises",
        started: "",
        catalog: "src/catalog.rs",
        mistakes: MISTAKES,
        finish: finished,
    }
    .write();
}

/// A file of fusion without its unit tests.
fn finished(file: &str, text: String) -> String {
    let text = if file == "lib.rs" { without_inner_lines(&text) } else { text };
    text.replace("#[cfg(test)]", "#[cfg(any())]")
}
