//! Copies the routers' sources, plants the mistakes of the catalogue in the copy, and writes their names.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

#[allow(dead_code, reason = "the tests read the rest")]
#[path = "src/catalog/mod.rs"]
mod catalog;

use catalog::{Edit, GROUPS};

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
    // A change of the routers that leaves a mistake behind is an error of the tests, not of everybody's build.
    let copied = Copy { root: &root, sources: &sources, out: &copy }.write();
    match copied {
        Ok(()) => {}
        Err(text) => fs::write(copy.join("lib.rs"), format!("compile_error!({text:?});")).expect("OUT_DIR is there"),
    }
    fs::write(out.join("mistake.rs"), mistakes()).expect("OUT_DIR can be written");
}

struct Copy<'a> {
    root: &'a Path,
    sources: &'a Path,
    out: &'a Path,
}

impl Copy<'_> {
    fn write(&self) -> Result<(), String> {
        let edits: Vec<&Edit> =
            GROUPS.iter().flat_map(|group| group.mistakes).flat_map(|planted| planted.edits).collect();
        // An edit that does not ask would change the healthy copy as well.
        for planted in GROUPS.iter().flat_map(|group| group.mistakes) {
            let asks = format!("broken!({})", planted.name);
            if planted.edits.is_empty() || planted.edits.iter().any(|edit| !edit.to.contains(&asks)) {
                return Err(format!("each edit of {} must ask `{asks}`", planted.name));
            }
        }
        for edit in &edits {
            if !self.sources.join(edit.file).is_file() {
                return Err(format!("{} is gone; a mistake of the catalogue is planted there", edit.file));
            }
        }
        self.folder(Path::new(""), &edits)
    }

    fn folder(&self, folder: &Path, edits: &[&Edit]) -> Result<(), String> {
        fs::create_dir_all(self.out.join(folder)).map_err(|error| error.to_string())?;
        let entries = fs::read_dir(self.sources.join(folder)).map_err(|error| error.to_string())?;
        for entry in entries {
            let entry = entry.map_err(|error| error.to_string())?;
            let path = folder.join(entry.file_name());
            if entry.path().is_dir() {
                self.folder(&path, edits)?;
            } else {
                let text = fs::read_to_string(entry.path()).map_err(|error| error.to_string())?;
                let text = self.edited(&path, text, edits)?;
                fs::write(self.out.join(path), text).map_err(|error| error.to_string())?;
            }
        }
        Ok(())
    }

    /// A file with its mistakes. Tests that are copied are ignored: they are run one at a time, each with a mistake.
    fn edited(&self, path: &Path, mut text: String, edits: &[&Edit]) -> Result<String, String> {
        for edit in edits.iter().filter(|edit| Path::new(edit.file) == path) {
            let found = text.matches(edit.from).count();
            if found != 1 {
                return Err(format!("{} must have this once, not {found} times:\n{}", edit.file, edit.from));
            }
            text = text.replacen(edit.from, edit.to, 1);
        }
        if path == Path::new("lib.rs") {
            // An included file has no attributes of a crate.
            let is_left_out = |line: &str| LEFT_OUT.iter().any(|module| line.ends_with(&format!("mod {module};")));
            let is_item = |line: &&str| !line.starts_with("//!") && !line.starts_with("#![") && !is_left_out(line);
            text = text.lines().filter(is_item).map(|line| format!("{line}\n")).collect();
        }
        // A page of the book beside the routers' sources.
        let text = text.replace("\"../../docs/", &format!("\"{}/docs/", self.root.display()));
        Ok(text.replace("#[test]", "#[test]\n#[ignore]"))
    }
}

/// The type `Mistake`, with its groups.
fn mistakes() -> String {
    let mut text = String::from("/// A planted mistake.\n#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]\n");
    text += "pub enum Mistake {\n";
    let all = || GROUPS.iter().flat_map(|group| group.mistakes);
    all().for_each(|planted| writeln!(text, "/// {}\n{},", planted.text, planted.name).expect("a String takes it"));
    text += "}\n\nimpl Mistake {\n";
    for group in GROUPS {
        let names: Vec<_> = group.mistakes.iter().map(|planted| format!("Self::{}", planted.name)).collect();
        let names = format!("[Self; {}] = [{}];", names.len(), names.join(", "));
        writeln!(text, "/// {}\npub const {}: {names}", group.text, group.name).expect("a String takes it");
    }
    text += "\nfn named(name: &str) -> Option<Self> {\nmatch name {\n";
    for planted in all() {
        writeln!(text, "\"{0}\" => Some(Self::{0}),", planted.name).expect("a String takes it");
    }
    text + "_ => None,\n}\n}\n}\n"
}
