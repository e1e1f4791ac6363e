//! One tree in three packages.

use super::needs::{self, Glibc};
use super::tree::{Profile, Tree};
use crate::cargo::{self, output};
use crate::failure::Failure;
use crate::files::{copy, empty_folder, read, write};
use crate::venv;
use std::path::{Path, PathBuf};
use std::process::Command;

const VERSION: &str = env!("CARGO_PKG_VERSION");
/// The kernel's name of the processor, which wheels and archives carry.
const PROCESSOR: &str = std::env::consts::ARCH;

/// Files that are given away.
pub(super) struct Packed {
    pub(super) debian: PathBuf,
    pub(super) tarball: PathBuf,
    pub(super) wheel: PathBuf,
}

/// Packs a tree into files in a folder; `work` below it has what is on the way.
pub(super) fn pack(profile: Profile, tree: &Tree, dist: &Path) -> Result<Packed, Failure> {
    let debian = debian(profile, tree, dist)?;
    Ok(Packed { debian, tarball: tarball(tree, dist)?, wheel: wheel(tree, dist)? })
}

fn debian(profile: Profile, tree: &Tree, dist: &Path) -> Result<PathBuf, Failure> {
    let (staged, architecture) = (dist.join("work/debian"), output(Command::new("dpkg").arg("--print-architecture"))?);
    let (architecture, Glibc(major, minor)) = (architecture.trim(), needs::glibc(&tree.binaries)?);
    copy_tree(&tree.folder, &staged.join("usr"))?;
    // Nobody reads mail for the project yet, and RFC 2606 gives `invalid` to nobody.
    let control = format!(
        "Package: rohrpost\nVersion: {VERSION}\nArchitecture: {architecture}\nSection: misc\nPriority: optional\n\
         Maintainer: The developers of Rohrpost <rohrpost@invalid>\nDepends: libc6 (>= {major}.{minor}), libgcc-s1\n\
         Description: prioritised mailboxes for robots\n The command `rohrpost`, which launches and watches the \
         programs of a robot, its library\n for C and C++, and the sources that `rohrpost new` needs.\n"
    );
    write(&staged.join("DEBIAN/control"), &control)?;
    let file = dist.join(format!("rohrpost_{VERSION}_{architecture}.deb"));
    // What is given away is small; what only a test installs is made in a moment.
    let strength = if profile == Profile::Release { "-Zxz" } else { "-Znone" };
    let mut pack = Command::new("dpkg-deb");
    pack.args(["--root-owner-group", strength, "--build"]).arg(&staged).arg(&file);
    cargo::run("packing for Debian", &mut pack)?;
    Ok(file)
}

fn tarball(tree: &Tree, dist: &Path) -> Result<PathBuf, Failure> {
    let name = format!("rohrpost-{VERSION}-{PROCESSOR}-linux");
    let file = dist.join(format!("{name}.tar.gz"));
    let mut pack = Command::new("tar");
    pack.args(["--create", "--gzip", "--sort=name", "--owner=0", "--group=0", "--numeric-owner"]);
    pack.arg("--file").arg(&file).arg("--directory").arg(&tree.folder);
    cargo::run("packing a tarball", pack.arg(format!("--transform=s,^\\.,{name},")).arg("."))?;
    Ok(file)
}

/// The package in Python as its own backend makes it, with what is built, the command and its files beside it.
fn wheel(tree: &Tree, dist: &Path) -> Result<PathBuf, Failure> {
    let (python, work) = (venv::clients()?, dist.join("work/wheel"));
    empty_folder(&work)?;
    let run = |why: &str, words: &[&str]| {
        cargo::run(why, Command::new(&python).arg("-m").args(words).current_dir(&work).env("ROHRPOST_PURE", "1"))
    };
    let source = cargo::root().join("clients/python");
    let words = ["pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-build-isolation"];
    run("packing the part of the Python package in Python", &[&words[..], &[&*source.to_string_lossy()]].concat())?;
    run("unpacking it", &["wheel", "unpack", &format!("rohrpost-{VERSION}-py3-none-any.whl")])?;
    let unpacked = work.join(format!("rohrpost-{VERSION}"));
    copy(&tree.python, &unpacked.join("rohrpost/_node.abi3.so"))?;
    let data = unpacked.join(format!("rohrpost-{VERSION}.data"));
    copy_tree(&tree.folder.join("bin"), &data.join("scripts"))?;
    copy_tree(&tree.folder.join("share"), &data.join("data/share"))?;
    let binaries = [&tree.binaries[..], std::slice::from_ref(&tree.python)].concat();
    let Glibc(major, minor) = needs::glibc(&binaries)?;
    let tag = format!("cp310-abi3-manylinux_{major}_{minor}_{PROCESSOR}");
    let about = unpacked.join(format!("rohrpost-{VERSION}.dist-info/WHEEL"));
    let text = read(&about)?.replace("Root-Is-Purelib: true", "Root-Is-Purelib: false");
    write(&about, &text.replace("Tag: py3-none-any", &format!("Tag: {tag}")))?;
    run("packing a wheel", &["wheel", "pack", "--dest-dir", &dist.to_string_lossy(), &unpacked.to_string_lossy()])?;
    Ok(dist.join(format!("rohrpost-{VERSION}-{tag}.whl")))
}

/// Copies a folder's content, with permissions; by links, since nothing changes it.
fn copy_tree(from: &Path, to: &Path) -> Result<(), Failure> {
    empty_folder(to)?;
    let mut copy = Command::new("cp");
    output(copy.args(["--recursive", "--link", "--no-target-directory"]).arg(from).arg(to)).map(drop)
}
