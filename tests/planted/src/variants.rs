//! Copies of some files, one for each mistake, as modules of one crate.

use crate::Edit;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Where copies come from, and go to.
pub struct Variants<'a> {
    /// Folder of the sources.
    pub sources: &'a str,
    /// Files of the crate's own `src` that stand in a variant beside the sources.
    pub ours: &'a [&'a str],
    /// The folder of a build script's output.
    pub out: &'a Path,
}

impl Variants<'_> {
    /// A file, by its name without `.rs`, as it can be included: without unit tests, and without the first comment.
    /// Lines keep their numbers.
    ///
    /// # Panics
    /// If it cannot be read.
    pub fn plain(&self, part: &str) -> String {
        let folder = if self.ours.contains(&part) { "src" } else { self.sources };
        let path = format!("{folder}/{part}.rs");
        let source = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let end = source.find("#[cfg(test)]\nmod tests {").unwrap_or(source.len());
        let is_inner = |line: &str| usize::from(line.starts_with("//!"));
        source[..end].lines().map(|line| line.replacen("//!", "// ", is_inner(line)) + "\n").collect()
    }

    /// Copies a file as it is.
    ///
    /// # Panics
    /// If that fails.
    pub fn copy(&self, part: &str) {
        let path = self.out.join(last(part)).with_extension("rs");
        fs::write(path, self.plain(part)).expect("the output can be written");
    }

    /// Writes the files of a variant, and returns its module, which ends with `items`.
    ///
    /// # Panics
    /// If an edit does not find its text once, or is of another file.
    pub fn variant(&self, parts: &[&str], name: &str, edits: &[Edit], items: &str) -> String {
        fs::create_dir_all(self.out.join(name)).expect("the output can be written");
        let mut module = format!("pub(crate) mod {name} {{\n");
        for part in parts {
            let mut text = self.plain(part);
            for edit in edits.iter().filter(|edit| edit.file == *part) {
                text = edit.apply(name, &text).unwrap_or_else(|error| panic!("{error}"));
            }
            for part in parts {
                let here = format!("super::{}::", last(part));
                text = text.replace(&format!("crate::{}::", part.replace('/', "::")), &here);
            }
            let path = self.out.join(name).join(last(part)).with_extension("rs");
            fs::write(&path, text).expect("the output can be written");
            writeln!(module, "pub(crate) mod {} {{ include!({path:?}); }}", last(part)).expect("a String takes all");
        }
        assert!(edits.iter().all(|edit| parts.contains(&edit.file)), "{name}: edits a file that is not its own");
        module + items + "}\n"
    }
}

/// The name of a part's module: that of its file.
fn last(part: &str) -> &str {
    part.rsplit('/').next().unwrap_or(part)
}
