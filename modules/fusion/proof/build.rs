//! Copies fusion's sources, plants the mistakes of the catalogue in the copy, and copies the tests.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

#[allow(dead_code, reason = "the tests read the rest")]
#[path = "src/catalog.rs"]
mod catalog;

use catalog::MISTAKES;

const SOURCES: &str = "../src";
const PROMISES: &str = "../tests/promises";

fn main() {
    for read in [SOURCES, PROMISES, "src/catalog.rs"] {
        println!("cargo:rerun-if-changed={read}");
    }
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    // A change of fusion that leaves a mistake behind is an error of the tests, not of everybody's build.
    let text = generate(out).unwrap_or_else(|error| format!("compile_error!({error:?});"));
    fs::write(out.join("mistaken.rs"), text).expect("OUT_DIR can be written");
}

/// Writes the copies, and returns what the crate includes.
fn generate(out: &Path) -> Result<String, String> {
    let (copy, tests) = (out.join("copy"), out.join("promises"));
    // An edit that does not ask would change the healthy copy as well.
    for mistake in MISTAKES {
        if !mistake.to.contains(&format!("broken!({})", mistake.name)) {
            return Err(format!("the edit of {0} must ask `broken!({0})`", mistake.name));
        }
        if !Path::new(SOURCES).join(mistake.file).with_extension("rs").is_file() {
            return Err(format!("{}.rs is gone; a mistake of the catalogue is planted there", mistake.file));
        }
    }
    copied(SOURCES, &copy, edited)?;
    // The promises run one at a time, each with a mistake, and all at once without.
    let promises = copied(PROMISES, &tests, |_, text| Ok(text.replace("#[test]", "#[test]\n#[ignore]")))?;
    let mut text = format!("include!({:?});\n", copy.join("lib.rs"));
    for promise in promises.iter().filter(|promise| *promise != "main") {
        let path = tests.join(promise).with_extension("rs");
        writeln!(text, "#[path = {path:?}]\nmod {promise};").expect("a String takes it");
    }
    for mistake in MISTAKES {
        writeln!(text, "#[test]\nfn {0}() {{ noticed::is_noticed({0:?}) }}", mistake.name).expect("a String takes it");
    }
    Ok(text)
}

/// Copies a folder's files, changed; returns their names without `.rs`.
fn copied(
    folder: &str,
    to: &Path,
    change: impl Fn(&str, String) -> Result<String, String>,
) -> Result<Vec<String>, String> {
    let failed = |error: std::io::Error| format!("{folder}: {error}");
    fs::create_dir_all(to).map_err(failed)?;
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let Some(name) = path.file_stem().and_then(|name| name.to_str()) else { continue };
        let text = change(name, fs::read_to_string(&path).map_err(failed)?)?;
        fs::write(to.join(name).with_extension("rs"), text).map_err(failed)?;
        names.push(name.to_owned());
    }
    names.sort();
    Ok(names)
}

/// A file of fusion with its mistakes and without its unit tests.
fn edited(file: &str, mut text: String) -> Result<String, String> {
    for mistake in MISTAKES.iter().filter(|mistake| mistake.file == file) {
        let found = text.matches(mistake.from).count();
        if found != 1 {
            return Err(format!("{file}.rs must have this once, not {found} times:\n{}", mistake.from));
        }
        text = text.replacen(mistake.from, mistake.to, 1);
    }
    if file == "lib" {
        // An included file has no comment and no attribute of its own.
        let is_inner = |line: &&str| line.starts_with("//!") || line.starts_with("#![");
        text = text.lines().filter(|line| !is_inner(line)).map(|line| format!("{line}\n")).collect();
    }
    Ok(text.replace("#[cfg(test)]", "#[cfg(any())]"))
}
