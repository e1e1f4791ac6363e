//! Copies the routers' sources, plants the mistakes of the catalogue in the copy, and writes their names.

use rohrpost_planted::{Edit, planted, without_inner_lines};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

#[allow(dead_code, reason = "the tests read the rest")]
#[path = "src/catalog/mod.rs"]
mod catalog;

use catalog::all;

/// Threads, sockets and namespaces: no mistake is planted there, and no core knows them.
const LEFT_OUT: [&str; 4] = ["shell", "tcp", "lab", "netlink"];

fn main() {
    let here = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let root = here.join("../../..").canonicalize().expect("the repository is above");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it"));
    let sources = root.join("routers/src");
    println!("cargo:rerun-if-changed=src/catalog");
    println!("cargo:rerun-if-changed={}", sources.display());
    let copy = out.join("copy");
    let _ = fs::remove_dir_all(&copy);
    fs::create_dir_all(&copy).expect("OUT_DIR can be written");
    let mistakes: Vec<(&str, &[Edit])> = all().map(|planted| (planted.name, planted.edits)).collect();
    // A change of the routers that leaves a mistake behind is an error of the tests, not of everybody's build.
    if let Err(text) = planted(&sources, &copy, &mistakes, |file, text| finished(&root, file, text)) {
        fs::write(copy.join("lib.rs"), format!("compile_error!({text:?});")).expect("OUT_DIR is there");
    }
    fs::write(out.join("mistake.rs"), names()).expect("OUT_DIR can be written");
}

/// A file with its mistakes. Tests that are copied are ignored: they are run one at a time, each with a mistake.
fn finished(root: &Path, file: &str, mut text: String) -> String {
    if file == "lib.rs" {
        let is_left_out = |line: &str| LEFT_OUT.iter().any(|module| line.ends_with(&format!("mod {module};")));
        text = without_inner_lines(&text).lines().filter(|line| !is_left_out(line)).collect::<Vec<_>>().join("\n");
    }
    // A page of the book beside the routers' sources.
    let text = text.replace("\"../../docs/", &format!("\"{}/docs/", root.display()));
    text.replace("#[test]", "#[test]\n#[ignore]")
}

/// The type `Mistake`.
fn names() -> String {
    let mut text = String::from("/// A planted mistake.\n#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]\n");
    text += "pub enum Mistake {\n";
    all().for_each(|planted| writeln!(text, "/// {}\n{},", planted.text, planted.name).expect("a String takes it"));
    text += "}\n\nimpl Mistake {\n";
    text += "fn named(name: &str) -> Option<Self> {\nmatch name {\n";
    for planted in all() {
        writeln!(text, "\"{0}\" => Some(Self::{0}),", planted.name).expect("a String takes it");
    }
    text + "_ => None,\n}\n}\n}\n"
}
