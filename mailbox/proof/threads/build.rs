//! Writes the slot core and the core of streams once as they are and once per broken variant, each beside its runs.
//! What is broken stands in the tables of the models (`../loom/src/broken`, `stream_broken.rs`), so that a change of a
//! core is followed in one place.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

#[allow(dead_code)]
#[path = "../loom/src/broken/mod.rs"]
mod broken;
#[path = "src/caught.rs"]
mod caught;
#[allow(dead_code)]
#[path = "../loom/src/stream_broken.rs"]
mod stream_broken;

use broken::Broken;
use caught::{CAUGHT, STREAM_CAUGHT};
use rohrpost_planted::Variants;

/// Files of this crate; the others are the mailbox's.
const OURS: [&str; 3] = ["rig", "runs", "stream_rig"];

/// A part of the mailbox that is proved by itself.
struct Proof {
    /// The module of the source as it is.
    real: &'static str,
    /// What a variant consists of; the last file has the runs.
    parts: &'static [&'static str],
    broken: &'static [&'static [Broken]],
    /// Variants that must be reported, each with its run.
    caught: &'static [(&'static str, &'static str)],
}

const PROOFS: [Proof; 2] = [
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
            "cell",
            "rig",
            "runs",
        ],
        broken: broken::BROKEN,
        caught: CAUGHT,
    },
    Proof {
        real: "real_stream",
        parts: &["stream/omission", "stream/ring", "stream/left_out", "stream/writing", "stream_rig"],
        broken: &[stream_broken::BROKEN],
        caught: STREAM_CAUGHT,
    },
];

fn main() {
    for read in ["src", "../loom/src/broken", "../loom/src/stream_broken.rs", "../../src"] {
        println!("cargo:rerun-if-changed={read}");
    }
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    // A change of the core that leaves us behind is an error of this crate's tests, not of everybody's build.
    let index = std::panic::catch_unwind(|| generate(out)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map_or("the variants cannot be generated", String::as_str);
        format!("compile_error!({text:?});")
    });
    fs::write(out.join("variants.rs"), index).expect("OUT_DIR can be written");
}

fn generate(out: &Path) -> String {
    let copies = Variants { sources: "../../src", ours: &OURS, out };
    copies.copy("name");
    let (mut modules, mut table) =
        (String::new(), String::from("pub(crate) const BROKEN: &[(&str, &str, fn())] = &[\n"));
    for proof in &PROOFS {
        let runs = proof.parts.last().expect("a proof has runs");
        modules.push_str(&copies.variant(proof.parts, proof.real, &[], ""));
        for (name, run) in proof.caught {
            let broken = proof.broken.iter().copied().flatten().find(|broken| broken.name == *name);
            let broken = broken.unwrap_or_else(|| panic!("caught.rs names {name}, which ../loom/src has no more"));
            assert!(broken.edits.iter().all(|edit| !OURS.contains(&edit.file)), "{name} breaks a rig, not the core");
            modules.push_str(&copies.variant(proof.parts, name, broken.edits, ""));
            writeln!(table, "({name:?}, {run:?}, {name}::{runs}::{run}),").expect("a String takes all");
        }
    }
    modules + &table + "];\n"
}
