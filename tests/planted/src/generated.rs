//! What build scripts write for the crates that they are of.

use crate::{Mistake, copied};
use std::path::Path;
use std::{env, fs};

/// Writes a file of the build script's output: what `generate` makes there of `reads`, or its error as one of the
/// compiler.
pub(crate) fn write(file: &str, reads: &[&str], generate: impl Fn(&Path) -> Result<String, String>) {
    for read in reads {
        println!("cargo:rerun-if-changed={read}");
    }
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    let text = generate(out).unwrap_or_else(|error| format!("compile_error!({error:?});"));
    fs::write(out.join(file), text).expect("OUT_DIR can be written");
}

/// Copies the files of a folder of tests, changed; returns their modules.
pub(crate) fn copies_of_tests(
    tests: &str,
    to: &Path,
    change: impl Fn(&str, String) -> String,
) -> Result<String, String> {
    let files = copied(Path::new(tests), to, |file, text| Ok(change(file, text)))?;
    let module = |file: &String| format!("#[path = {:?}]\nmod {};", to.join(file), file.trim_end_matches(".rs"));
    Ok(lines(files.iter().filter(|file| *file != "main.rs").map(module)))
}

/// A test for each mistake; `catalog` is where it is found then.
pub(crate) fn tests_of<'a>(mistakes: impl IntoIterator<Item = &'a Mistake>, catalog: &str) -> String {
    let test = |name: &str| format!("#[test]\nfn {name}() {{ rohrpost_planted::is_noticed({catalog}, {name:?}) }}");
    lines(mistakes.into_iter().map(|mistake| test(mistake.name)))
}

pub(crate) fn lines(lines: impl IntoIterator<Item = String>) -> String {
    lines.into_iter().map(|line| line + "\n").collect()
}
