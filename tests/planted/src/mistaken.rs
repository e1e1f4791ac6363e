//! A copy of a crate with all mistakes of a catalogue, beside copies of the tests that must notice them.

use crate::{Edit, copied, planted};
use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

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
    /// Each mistake, with its edits.
    pub mistakes: Vec<(&'a str, &'a [Edit])>,
    /// What else changes in a file of the sources.
    pub finish: fn(&str, String) -> String,
}

impl Mistaken<'_> {
    /// Writes the copies, and `mistaken.rs`, which the crate includes: with a test of the name of each mistake, that
    /// calls `noticed::is_noticed`. A change of the sources that leaves a mistake behind is an error of these tests and
    /// not of the build.
    ///
    /// # Panics
    /// Outside of a build script.
    pub fn write(&self) {
        for read in [self.sources, self.tests, self.catalog] {
            println!("cargo:rerun-if-changed={read}");
        }
        let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
        let out = Path::new(&out);
        let text = self.generate(out).unwrap_or_else(|error| format!("compile_error!({error:?});"));
        fs::write(out.join("mistaken.rs"), text).expect("OUT_DIR can be written");
    }

    fn generate(&self, out: &Path) -> Result<String, String> {
        let (copy, tests) = (out.join("copy"), out.join("tests"));
        planted(Path::new(self.sources), &copy, &self.mistakes, self.finish)?;
        let files = copied(Path::new(self.tests), &tests, |file, text| {
            Ok(if file == self.started { text } else { text.replace("#[test]", "#[test]\n#[ignore]") })
        })?;
        let mut text = format!("include!({:?});\n", copy.join("lib.rs"));
        for file in files.iter().filter(|file| *file != "main.rs") {
            let (path, module) = (tests.join(file), file.trim_end_matches(".rs"));
            writeln!(text, "#[path = {path:?}]\nmod {module};").expect("a String takes it");
        }
        for (name, _) in &self.mistakes {
            writeln!(text, "#[test]\nfn {name}() {{ noticed::is_noticed({name:?}) }}").expect("a String takes it");
        }
        Ok(text)
    }
}
