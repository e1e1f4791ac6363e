//! Copies the mailbox's sources, plants the mistakes of the catalogue in the copy, and copies the scenes, for
//! `tests/mistaken`.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

#[allow(dead_code, reason = "the tests read the rest")]
#[path = "tests/mistaken/catalog.rs"]
mod catalog;

use catalog::MISTAKES;

const SOURCES: &str = "../../src";
const SCENES: &str = "tests/crash";

fn main() {
    for read in [SOURCES, SCENES, "tests/mistaken/catalog.rs"] {
        println!("cargo:rerun-if-changed={read}");
    }
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    // A change of the mailbox that leaves a mistake behind is an error of the tests, not of everybody's build.
    let text = generate(out).unwrap_or_else(|error| format!("compile_error!({error:?});"));
    fs::write(out.join("mistaken.rs"), text).expect("OUT_DIR can be written");
}

/// Writes the copies, and returns what the crate of the tests includes.
fn generate(out: &Path) -> Result<String, String> {
    let copy = out.join("copy");
    // An edit that does not ask would change the healthy copy as well.
    for mistake in MISTAKES {
        let asks = format!("broken!({})", mistake.name);
        if mistake.edits.is_empty() || mistake.edits.iter().any(|edit| !edit.to.contains(&asks)) {
            return Err(format!("each edit of {} must ask `{asks}`", mistake.name));
        }
    }
    copied(SOURCES, &copy, edited)?;
    // The scenes run one at a time, each with a mistake, and all at once without.
    let scenes = copied(SCENES, &copy, |file, text| {
        Ok(if file == "victim" { text } else { text.replace("#[test]", "#[test]\n#[ignore]") })
    })?;
    for edit in MISTAKES.iter().flat_map(|mistake| mistake.edits) {
        if !copy.join(edit.file).with_extension("rs").is_file() {
            return Err(format!("{}.rs is gone; a mistake of the catalogue is planted there", edit.file));
        }
    }
    let mut text = format!("include!({:?});\n", copy.join("lib.rs"));
    for scene in scenes.iter().filter(|scene| *scene != "main") {
        let path = copy.join(scene).with_extension("rs");
        writeln!(text, "#[path = {path:?}]\nmod {scene};").expect("a String takes it");
    }
    for mistake in MISTAKES {
        writeln!(text, "#[test]\nfn {0}() {{ noticed::is_noticed({0:?}) }}", mistake.name).expect("a String takes it");
    }
    Ok(text)
}

/// Copies the files of a folder and of those in it, changed; returns their names without `.rs`.
fn copied(
    folder: &str,
    to: &Path,
    change: impl Fn(&str, String) -> Result<String, String>,
) -> Result<Vec<String>, String> {
    let failed = |error: std::io::Error| format!("{folder}: {error}");
    let mut names = Vec::new();
    let mut folders = vec![String::new()];
    while let Some(inner) = folders.pop() {
        fs::create_dir_all(to.join(&inner)).map_err(failed)?;
        for entry in fs::read_dir(Path::new(folder).join(&inner)).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let Some(name) = path.file_stem().and_then(|name| name.to_str()) else { continue };
            let name = format!("{inner}{name}");
            if path.is_dir() {
                folders.push(name + "/");
                continue;
            }
            let text = change(&name, fs::read_to_string(&path).map_err(failed)?)?;
            fs::write(to.join(&name).with_extension("rs"), text).map_err(failed)?;
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

/// A file of the mailbox with its mistakes and without its unit tests.
fn edited(file: &str, mut text: String) -> Result<String, String> {
    for edit in MISTAKES.iter().flat_map(|mistake| mistake.edits).filter(|edit| edit.file == file) {
        let found = text.matches(edit.from).count();
        if found != 1 {
            return Err(format!("{file}.rs must have this once, not {found} times:\n{}", edit.from));
        }
        text = text.replacen(edit.from, edit.to, 1);
    }
    if file == "lib" {
        // An included file has no comment of its own.
        text = text.lines().filter(|line| !line.starts_with("//!")).map(|line| format!("{line}\n")).collect();
        text = text.replace("mod causes;", "#[macro_use]\nmod causes;");
    }
    // Within one file an exported macro has no path.
    let text = text.replace("#[macro_export]\n", "").replace("crate::causes!", "causes!");
    Ok(text.replace("#[cfg(test)]", "#[cfg(any())]"))
}
