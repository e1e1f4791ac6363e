//! A copy of a crate with all mistakes of a catalogue, beside copies of the tests that must notice them.

use crate::generated::{copies_of_tests, lines, tests_of, write};
use crate::{Mistake, planted};
use std::path::Path;

/// What the build script of such a copy does.
pub struct Mistaken<'a> {
    /// Folder of the sources.
    pub sources: &'a str,
    /// Folder of the tests. They run one at a time, each with a mistake, and all at once without.
    pub tests: &'a str,
    /// A file among them of which the tests are no such tests, but what these start.
    pub started: &'a str,
    /// File of the catalogue.
    pub catalog: &'a str,
    /// What it has.
    pub mistakes: &'a [Mistake],
    /// What else changes in a file of the sources.
    pub finish: fn(&str, String) -> String,
}

impl Mistaken<'_> {
    /// Writes the copies, and `mistaken.rs`, which the crate includes: with a test of the name of each mistake, that
    /// looks it up in the crate's `catalog::MISTAKES`. A change of the sources that leaves a mistake behind is an error
    /// of these tests and not of the build.
    ///
    /// # Panics
    /// Outside of a build script.
    pub fn write(&self) {
        write("mistaken.rs", &[self.sources, self.tests, self.catalog], |out| self.generate(out));
    }

    fn generate(&self, out: &Path) -> Result<String, String> {
        let copy = out.join("copy");
        planted(Path::new(self.sources), &copy, &Mistake::edits(self.mistakes), self.finish)?;
        let is_test = |file: &str| file != self.started;
        let modules = copies_of_tests(self.tests, &out.join("tests"), |file, text| {
            if is_test(file) { text.replace("#[test]", "#[test]\n#[ignore]") } else { text }
        })?;
        Ok(lines([format!("include!({:?});", copy.join("lib.rs"))])
            + &modules
            + &tests_of(self.mistakes, "&[crate::catalog::MISTAKES]"))
    }
}
