//! A core, compiled as it is and with all mistakes of a catalogue, with models of it beside each.

use crate::generated::{copies_of_tests, lines, tests_of, write};
use crate::{Catalog, Mistake, planted, without_inner_lines};
use std::env;
use std::path::Path;

/// A file of the crate's own `src` that is compiled within the core: there it sees what is private.
pub struct Part<'a> {
    /// File of the core: the part becomes a child of its module.
    pub of: &'a str,
    /// The part's module.
    pub module: &'a str,
    /// File of the part, without `.rs`.
    pub file: &'a str,
}

/// What the build script of a crate of models does.
pub struct Models<'a> {
    /// Folder of the core's sources.
    pub core: &'a str,
    /// The models, and those of their parts that need what is private.
    pub parts: &'a [Part<'a>],
    /// Crate name and folder of tests of the core that run beside the mistaken one, as module `simulation`.
    pub tests: Option<(&'a str, &'a str)>,
    /// The crate's `catalog::MISTAKES`.
    pub catalog: &'a Catalog,
}

impl Models<'_> {
    /// Writes `cores.rs`, which the crate includes as its module `cores`: modules `real` and `mistaken`, and a test for
    /// each mistake. A change of the core that leaves a mistake behind is an error of these tests and not of the build.
    ///
    /// # Panics
    /// Outside of a build script.
    pub fn write(&self) {
        let tests = self.tests.map_or("src", |(_, folder)| folder);
        write("cores.rs", &[self.core, "src", tests], |out| self.generate(out));
    }

    fn generate(&self, out: &Path) -> Result<String, String> {
        let mistakes = || self.catalog.iter().copied().flatten();
        let mut text = String::new();
        for (core, mistakes) in [("real", Vec::new()), ("mistaken", Mistake::edits(mistakes()))] {
            let copy = out.join(core);
            planted(Path::new(self.core), &copy, &mistakes, |file, text| self.finished(core, file, &text))?;
            text += &format!("#[path = {:?}]\npub(crate) mod {core};\n", copy.join("lib.rs"));
        }
        if let Some((name, folder)) = self.tests {
            let (here, core) = ("crate::cores::simulation::", "crate::cores::mistaken::");
            text += "mod simulation {\n";
            text += &copies_of_tests(folder, &out.join("tests"), |_, text| {
                let text = text.replace("crate::", here).replace(&format!("{name}::"), core);
                text.replace("#[test]", "#[test]\n#[ignore]")
            })?;
            text += "}\n";
        }
        Ok(text + &tests_of(mistakes(), "crate::catalog::MISTAKES"))
    }

    /// A file of the core as a part of this crate: without its unit tests, and with what belongs in it.
    fn finished(&self, core: &str, file: &str, text: &str) -> String {
        let here = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
        let text = text.replace("#[cfg(test)]", "#[cfg(any())]").replace("crate::", &format!("crate::cores::{core}::"));
        let text = if file == "lib.rs" { without_inner_lines(&text) } else { text };
        let parts = self.parts.iter().filter(|part| part.of == file);
        text + &lines(
            parts.map(|Part { module, file, .. }| {
                format!("#[path = \"{here}/src/{file}.rs\"]\npub(crate) mod {module};")
            }),
        )
    }
}
