//! Writes the slot core, the cells and the core of streams once as they are and once per broken variant, each beside
//! its models, with loom's atomics.

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

use broken::Broken;
use mirrored::MIRRORED;
use rohrpost_planted::Variants;

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
        parts: &[
            "slots/word",
            "slots/full",
            "slots/hot",
            "slots/bodies",
            "slots/protocol",
            "slots/queue",
            "wake/bell",
            "rig",
            "models",
        ],
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
    let copies = Variants { sources: MAILBOX, ours: &OURS, out };
    for mirrored in MIRRORED {
        let mut rest = copies.plain(mirrored.file);
        for line in mirrored.lines {
            let at =
                rest.find(line).unwrap_or_else(|| panic!("{}: `{line}` is gone: {}", mirrored.file, mirrored.what));
            rest.drain(..at + line.len());
        }
    }
    copies.copy("name");
    let index: String = PROOFS.iter().map(|proof| variants(&copies, proof)).collect();
    fs::write(out.join("variants.rs"), index).expect("OUT_DIR can be written");
}

/// The modules of a proof's variants, with their tests.
fn variants(copies: &Variants, proof: &Proof) -> String {
    let models = proof.parts.last().expect("a proof has models");
    let mut tests = String::new();
    for (model, preemptions) in proof.models {
        let catches = proof.broken.iter().copied().flatten().any(|broken| broken.caught_by == *model);
        assert!(catches, "no variant names the model {model}: what does it prove?");
        let test = format!("#[test] fn {model}() {{ crate::holds({preemptions}, {models}::{model}); }}\n");
        tests.push_str(&test);
    }
    let mut index = copies.variant(proof.parts, proof.real, &[], &tests);
    for broken in proof.broken.iter().copied().flatten() {
        let (_, preemptions) =
            proof.models.iter().find(|(model, _)| *model == broken.caught_by).expect("`caught_by` names a model");
        let test = format!(
            "#[test] fn is_caught() {{ crate::is_caught({:?}, {preemptions}, {models}::{}); }}\n",
            broken.says, broken.caught_by
        );
        index.push_str(&copies.variant(proof.parts, broken.name, broken.edits, &test));
    }
    index
}
