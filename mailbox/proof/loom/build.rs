//! Writes the slot core once as it is and once per broken variant, each beside the models, with loom's atomics.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

#[path = "src/broken.rs"]
mod broken;

use broken::{BROKEN, Edit, MIRRORED, MODELS};

const MAILBOX: &str = "../../src";
/// What a variant consists of: the mailbox's, and ours.
const PARTS: [&str; 7] = ["word", "hot", "slots", "queue", "bell", "rig", "models"];
const OURS: [&str; 2] = ["rig", "models"];

fn main() {
    println!("cargo:rerun-if-changed=src");
    println!("cargo:rerun-if-changed={MAILBOX}");
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    // A change of the core that leaves the models behind is an error of the tests, not of everybody's build.
    if let Err(panic) = std::panic::catch_unwind(|| generate(out)) {
        let text = panic.downcast_ref::<String>().map_or("the models cannot be generated", String::as_str);
        fs::write(out.join("variants.rs"), format!("compile_error!({text:?});")).expect("OUT_DIR can be written");
    }
}

fn generate(out: &Path) {
    for mirrored in MIRRORED {
        let mut rest = plain(&source(mirrored.file));
        for line in mirrored.lines {
            let at =
                rest.find(line).unwrap_or_else(|| panic!("{}: `{line}` is gone: {}", mirrored.file, mirrored.what));
            rest.drain(..at + line.len());
        }
    }
    fs::write(out.join("name.rs"), plain(&source("name"))).expect("OUT_DIR can be written");

    let mut index = String::new();
    for (model, preemptions) in MODELS {
        let test = format!("#[test] fn {model}() {{ crate::holds({preemptions}, models::{model}); }}\n");
        index.push_str(&test);
    }
    let mut index = variant(out, "real", &[], &index);
    for broken in BROKEN {
        let (_, preemptions) =
            MODELS.iter().find(|(model, _)| *model == broken.caught_by).expect("`caught_by` names a model");
        let test = format!(
            "#[test] fn is_caught() {{ crate::is_caught({:?}, {preemptions}, models::{}); }}\n",
            broken.says, broken.caught_by
        );
        index.push_str(&variant(out, broken.name, broken.edits, &test));
    }
    fs::write(out.join("variants.rs"), index).expect("OUT_DIR can be written");
}

/// Writes the files of a variant, and returns its module.
fn variant(out: &Path, name: &str, edits: &[Edit], tests: &str) -> String {
    fs::create_dir_all(out.join(name)).expect("OUT_DIR can be written");
    let mut module = format!("mod {name} {{\n");
    for part in PARTS {
        let mut text = plain(&source(part));
        for edit in edits.iter().filter(|edit| edit.file == part) {
            let found = text.matches(edit.from).count();
            assert_eq!(found, 1, "variant {name}: {part}.rs must have this once, not {found} times:\n{}", edit.from);
            text = text.replacen(edit.from, edit.to, 1);
        }
        for part in PARTS {
            text = text.replace(&format!("crate::{part}::"), &format!("super::{part}::"));
        }
        fs::write(out.join(name).join(part).with_extension("rs"), text).expect("OUT_DIR can be written");
        writeln!(module, "mod {part} {{ include!(concat!(env!(\"OUT_DIR\"), \"/{name}/{part}.rs\")); }}")
            .expect("a String takes all");
    }
    assert!(edits.iter().all(|edit| PARTS.contains(&edit.file)), "variant {name}: edits a file that is not its own");
    module + tests + "}\n"
}

fn source(part: &str) -> String {
    let path = if OURS.contains(&part) { format!("src/{part}.rs") } else { format!("{MAILBOX}/{part}.rs") };
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Without unit tests, and without the first comment, which an included file may not have. CacheLine numbers stay.
fn plain(source: &str) -> String {
    let end = source.find("#[cfg(test)]\nmod tests {").unwrap_or(source.len());
    source[..end].lines().map(|line| line.replacen("//!", "// ", usize::from(line.starts_with("//!"))) + "\n").collect()
}
