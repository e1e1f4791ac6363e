//! Writes the slot core once as it is and once per broken variant, each beside the runs. What is broken stands in the
//! tables of the models (`../loom/src/broken`), so that a change of the core is followed in one place.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

#[allow(dead_code)]
#[path = "../loom/src/broken/mod.rs"]
mod broken;
#[path = "src/caught.rs"]
mod caught;

use broken::{BROKEN, Edit};
use caught::CAUGHT;

const CORE: [&str; 8] = ["word", "full", "hot", "bodies", "slots", "queue", "bell", "cell"];
const OURS: [&str; 2] = ["rig", "runs"];

fn main() {
    for read in ["src", "../loom/src/broken", "../../src"] {
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
    fs::write(out.join("name.rs"), plain(&source("name"))).expect("OUT_DIR can be written");
    let mut modules = variant(out, "real", &[]);
    let mut table = String::from("pub(crate) const BROKEN: &[(&str, &str, fn())] = &[\n");
    for (name, run) in CAUGHT {
        let broken = BROKEN.iter().copied().flatten().find(|broken| broken.name == *name);
        let broken = broken.unwrap_or_else(|| panic!("caught.rs names {name}, which ../loom/src/broken has no more"));
        modules.push_str(&variant(out, name, broken.edits));
        writeln!(table, "({name:?}, {run:?}, {name}::runs::{run}),").expect("a String takes all");
    }
    modules + &table + "];\n"
}

/// Writes the files of a variant, and returns its module.
fn variant(out: &Path, name: &str, edits: &[Edit]) -> String {
    fs::create_dir_all(out.join(name)).expect("OUT_DIR can be written");
    let mut module = format!("pub(crate) mod {name} {{\n");
    for part in CORE.iter().chain(&OURS) {
        let mut text = plain(&source(part));
        for edit in edits.iter().filter(|edit| edit.file == *part) {
            let found = text.matches(edit.from).count();
            assert_eq!(found, 1, "variant {name}: {part}.rs must have this once, not {found} times:\n{}", edit.from);
            text = text.replacen(edit.from, edit.to, 1);
        }
        for part in CORE.iter().chain(&OURS) {
            text = text.replace(&format!("crate::{part}::"), &format!("super::{part}::"));
        }
        let path = out.join(name).join(part).with_extension("rs");
        fs::write(&path, text).expect("OUT_DIR can be written");
        writeln!(module, "pub(crate) mod {part} {{ include!({path:?}); }}").expect("a String takes all");
    }
    assert!(edits.iter().all(|edit| CORE.contains(&edit.file)), "variant {name}: edits what is not of the core");
    module + "}\n"
}

fn source(part: &str) -> String {
    let folder = if OURS.contains(&part) { "src" } else { "../../src" };
    let path = format!("{folder}/{part}.rs");
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Without unit tests, and without the first comment, which an included file may not have. CacheLine numbers stay.
fn plain(source: &str) -> String {
    let end = source.find("#[cfg(test)]\nmod tests {").unwrap_or(source.len());
    source[..end].lines().map(|line| line.replacen("//!", "// ", usize::from(line.starts_with("//!"))) + "\n").collect()
}
