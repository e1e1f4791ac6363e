//! Packages for crates.io: what a project gets that depends on a crate of ours.

use crate::cargo::{self, cargo, output};
use crate::failure::Failure;
use crate::files::read;
use std::process::Command;

/// Packs all crates that are to be published. Whether each compiles without this clone, `cargo package --workspace`
/// with the same words less `--no-verify` says, in many minutes.
pub(crate) fn pack() -> Result<(), Failure> {
    let mut pack = cargo(&["package", "--workspace", "--no-verify", "--allow-dirty", "--quiet"]);
    for package in unpublished()? {
        pack.args(["--exclude", &package]);
    }
    cargo::run("packing crates as crates.io takes them", &mut pack)
}

/// Members of the workspace with `publish = false` in their manifests.
fn unpublished() -> Result<Vec<String>, Failure> {
    let root = cargo::root();
    let manifests =
        output(Command::new("git").args(["ls-files", "*/Cargo.toml", ":!benches/zenoh"]).current_dir(&root))?;
    let texts: Vec<String> = manifests.lines().map(|file| read(&root.join(file))).collect::<Result<_, _>>()?;
    let kept = texts.iter().filter(|text| text.contains("\npublish = false\n"));
    Ok(kept.filter_map(|text| Some(text.split_once("name = \"")?.1.split_once('"')?.0.to_owned())).collect())
}
