//! Writes the slot core, the cells and the core of streams once as they are and once per broken variant, each beside
//! its models, with loom's atomics.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

#[path = "src/broken/mod.rs"]
mod broken;
#[path = "src/cell_broken.rs"]
mod cell_broken;
#[path = "src/mirrored.rs"]
mod mirrored;
#[path = "src/stream_broken.rs"]
mod stream_broken;

use broken::{Broken, Edit};
use mirrored::MIRRORED;

const MAILBOX: &str = "../../src";
/// Files of this crate; the others are the mailbox's.
const OURS: [&str; 5] = ["rig", "models", "cell_models", "stream_rig", "stream_models"];

/// A part of the mailbox that is proved by itself.
struct Proof {
    /// The module of the source as it is.
    real: &'static str,
    /// What a variant consists of; the last file has the models.
    parts: &'static [&'static str],
    /// Each model and the bound on its preemptions.
    models: &'static [(&'static str, usize)],
    /// Its variants, in groups.
    broken: &'static [&'static [Broken]],
}

const PROOFS: [Proof; 3] = [
    Proof {
        real: "real",
        parts: &["word", "full", "hot", "bodies", "slots", "queue", "bell", "rig", "models"],
        models: broken::MODELS,
        broken: broken::BROKEN,
    },
    Proof {
        real: "real_cell",
        parts: &["cell", "cell_models"],
        models: cell_broken::MODELS,
        broken: &[cell_broken::BROKEN],
    },
    Proof {
        real: "real_stream",
        parts: &[
            "stream/omission",
            "stream/ring",
            "stream/left_out",
            "stream/missed",
            "stream/writing",
            "stream/lookup",
            "stream_rig",
            "stream_models",
        ],
        models: stream_broken::MODELS,
        broken: &[stream_broken::BROKEN],
    },
];

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

    let index: String = PROOFS.iter().map(|proof| variants(out, proof)).collect();
    fs::write(out.join("variants.rs"), index).expect("OUT_DIR can be written");
}

/// The modules of a proof's variants, with their tests.
fn variants(out: &Path, proof: &Proof) -> String {
    let models = last(proof.parts.last().expect("a proof has models"));
    let mut tests = String::new();
    for (model, preemptions) in proof.models {
        let catches = proof.broken.iter().copied().flatten().any(|broken| broken.caught_by == *model);
        assert!(catches, "no variant names the model {model}: what does it prove?");
        let test = format!("#[test] fn {model}() {{ crate::holds({preemptions}, {models}::{model}); }}\n");
        tests.push_str(&test);
    }
    let mut index = variant(out, proof.parts, proof.real, &[], &tests);
    for broken in proof.broken.iter().copied().flatten() {
        let (_, preemptions) =
            proof.models.iter().find(|(model, _)| *model == broken.caught_by).expect("`caught_by` names a model");
        let test = format!(
            "#[test] fn is_caught() {{ crate::is_caught({:?}, {preemptions}, {models}::{}); }}\n",
            broken.says, broken.caught_by
        );
        index.push_str(&variant(out, proof.parts, broken.name, broken.edits, &test));
    }
    index
}

/// Writes the files of a variant, and returns its module.
fn variant(out: &Path, parts: &[&str], name: &str, edits: &[Edit], tests: &str) -> String {
    fs::create_dir_all(out.join(name)).expect("OUT_DIR can be written");
    let mut module = format!("mod {name} {{\n");
    for part in parts {
        let mut text = plain(&source(part));
        for edit in edits.iter().filter(|edit| edit.file == *part) {
            let found = text.matches(edit.from).count();
            assert_eq!(found, 1, "variant {name}: {part}.rs must have this once, not {found} times:\n{}", edit.from);
            text = text.replacen(edit.from, edit.to, 1);
        }
        for part in parts {
            text = text.replace(&format!("crate::{}::", part.replace('/', "::")), &format!("super::{}::", last(part)));
        }
        let part = last(part);
        fs::write(out.join(name).join(part).with_extension("rs"), text).expect("OUT_DIR can be written");
        writeln!(module, "mod {part} {{ include!(concat!(env!(\"OUT_DIR\"), \"/{name}/{part}.rs\")); }}")
            .expect("a String takes all");
    }
    assert!(edits.iter().all(|edit| parts.contains(&edit.file)), "variant {name}: edits a file that is not its own");
    module + tests + "}\n"
}

/// The name of a part's module: that of its file.
fn last(part: &str) -> &str {
    part.rsplit('/').next().unwrap_or(part)
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
