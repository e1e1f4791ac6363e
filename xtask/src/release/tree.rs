//! The files of a release below one folder, which becomes `/usr`, or any other: nothing in it names its place but the
//! unit of systemd.

use crate::c_client;
use crate::cargo::{self, BRIDGE, cargo, output};
use crate::failure::Failure;
use crate::files::{copy, copy_into, read, write};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Shells, and where each looks for completions of what is installed.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "share/bash-completion/completions/rohrpost"),
    ("zsh", "share/zsh/vendor-completions/_rohrpost"),
    ("fish", "share/fish/vendor_completions.d/rohrpost.fish"),
];
/// What Cargo adds to a package's own files.
const ADDED_BY_CARGO: [&str; 3] = [".cargo_vcs_info.json", "Cargo.lock", "Cargo.toml.orig"];

/// How programs are built that are to be packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Profile {
    /// As the tests have built them.
    Dev,
    Release,
}

impl Profile {
    /// The folder of the build's products.
    fn folder(self) -> PathBuf {
        cargo::target().join(if self == Self::Dev { "debug" } else { "release" })
    }
}

/// What is packed.
pub(super) struct Tree {
    pub(super) folder: PathBuf,
    /// Programs and libraries: what they need, a package needs.
    pub(super) binaries: Vec<PathBuf>,
    /// The part of the package in Python that is Rust; not in the folder.
    pub(super) python: PathBuf,
}

/// Copies and makes all files. The folder must be empty.
pub(super) fn lay(profile: Profile, has_bridge: bool, folder: &Path) -> Result<Tree, Failure> {
    let built = profile.folder();
    let python = folder.with_file_name("_node.abi3.so");
    copy(&built.join("lib_node.so"), &python)?;
    copy_into(&built.join("rohrpost"), &folder.join("bin"))?;
    if has_bridge {
        copy_into(&built.join(BRIDGE), &folder.join("bin"))?;
    }
    // `pkg-config` knows where the description is.
    c_client::place(&built, &["librohrpost_c.so"], folder, "${pcfiledir}/../..")?;
    let mut binaries = vec![folder.join("bin/rohrpost"), folder.join("lib/librohrpost_c.so")];
    binaries.extend(has_bridge.then(|| folder.join("bin").join(BRIDGE)));
    let mut strip = Command::new("strip");
    cargo::run("leaving out symbols", strip.arg("--strip-unneeded").args(&binaries).arg(&python))?;
    make_texts(folder)?;
    copy_sources(&folder.join("share/rohrpost/src"))?;
    Ok(Tree { folder: folder.to_owned(), binaries, python })
}

/// What the command itself writes, the unit, and the licences.
fn make_texts(folder: &Path) -> Result<(), Failure> {
    // Found by PATH, so the scripts name it without a folder.
    let command = || {
        let mut command = Command::new("rohrpost");
        command.env("PATH", folder.join("bin"));
        command
    };
    for (shell, file) in COMPLETIONS {
        write(&folder.join(file), &output(command().args(["completions", shell]))?)?;
    }
    output(command().arg("man").arg(folder.join("share/man/man1")))?;
    let root = cargo::root();
    let unit = read(&root.join("config/rohrpost@.service"))?;
    write(&folder.join("lib/systemd/system/rohrpost@.service"), &unit.replace("/usr/local/bin/", "/usr/bin/"))?;
    let licences = [read(&root.join("LICENSE-MIT"))?, read(&root.join("LICENSE-APACHE"))?].join("\n\n");
    write(&folder.join("share/doc/rohrpost/copyright"), &format!("MIT or Apache 2.0, as you like.\n\n{licences}"))
}

/// Sources of the library for modules, to which `rohrpost new` leads: the files that Cargo would publish, less tests.
fn copy_sources(to: &Path) -> Result<(), Failure> {
    let root = cargo::root();
    let tree = ["tree", "--package", "rohrpost", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"];
    let mut packages: Vec<String> = output(&mut cargo(&tree))?.lines().filter_map(own_package).collect();
    packages.sort_unstable();
    packages.dedup();
    for package in packages {
        let (name, folder) = package.split_once(' ').unwrap_or_default();
        let within = Path::new(folder).strip_prefix(&root).map_err(|_| format!("{folder} is not in this clone"))?;
        let listed = output(&mut cargo(&["package", "--list", "--allow-dirty", "--package", name]))?;
        for file in listed.lines().filter(|file| is_source(file)) {
            copy(&root.join(within).join(file), &to.join(within).join(file))?;
        }
    }
    Ok(())
}

/// Name and folder of a package of this workspace, in a line of `cargo tree`: `rohrpost-team v0.1.0 (/work/team)`.
fn own_package(line: &str) -> Option<String> {
    let (what, _) = line.trim_end_matches(" (*)").rsplit_once(')')?;
    let (what, folder) = what.rsplit_once(" (/")?;
    Some(format!("{} /{folder}", what.split(' ').next()?))
}

fn is_source(file: &str) -> bool {
    !ADDED_BY_CARGO.contains(&file)
        && !["tests/", "benches/", "examples/"].iter().any(|folder| file.starts_with(folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_packages_are_told_from_others() {
        for (line, package) in [
            ("rohrpost v0.1.0 (/work/robots (new))", Some("rohrpost /work/robots (new)")),
            (
                "rohrpost-macros v0.1.0 (proc-macro) (/work/modules/macros)",
                Some("rohrpost-macros /work/modules/macros"),
            ),
            ("rohrpost-mailbox v0.1.0 (/work/mailbox) (*)", Some("rohrpost-mailbox /work/mailbox")),
            ("syn v2.0.1", None),
            ("serde_derive v1.0.2 (proc-macro) (*)", None),
        ] {
            assert_eq!(own_package(line).as_deref(), package, "{line}");
        }
    }

    #[test]
    fn tests_and_what_cargo_adds_are_no_sources() {
        for (file, is) in [("src/lib.rs", true), ("demo.toml", true), ("tests/api.rs", false), ("Cargo.lock", false)] {
            assert_eq!(is_source(file), is, "{file}");
        }
    }
}
