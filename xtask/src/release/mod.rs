//! `cargo xtask release`: a package for Debian, a tarball and a wheel in `target/dist`, each of them tried.
//!
//! ```text
//! cargo build ──▶ tree: bin/ lib/ include/ share/ ─┬─▶ dpkg-deb ─▶ .deb ──▶ an empty root: demo
//!                                                  ├─▶ tar ──────▶ .tar.gz
//!                            package in Python ────┴─▶ wheel ────▶ .whl ──▶ a fresh venv: demo
//! ```
//!
//! A `.deb` is a tree and a page of control fields, which `dpkg-deb` packs. `cargo-deb` would do the same, after
//! minutes of compiling it in each clean check; the same tree is needed for the other two anyway.

pub(crate) mod crates_io;
mod needs;
mod packages;
mod tree;
mod trial;

use crate::c_client;
use crate::cargo::{self, BRIDGE, checked};
use crate::failure::Failure;
use crate::files::empty_folder;
use std::path::Path;
use std::process::ExitCode;

pub(crate) use tree::Profile;

/// `cargo xtask release [--profile dev|release] [--bridge]`.
pub(crate) fn command(args: &[String]) -> Result<ExitCode, Failure> {
    let (mut profile, mut has_bridge) = (Profile::Release, false);
    let mut words = args.iter().map(String::as_str);
    while let Some(word) = words.next() {
        match word {
            "--bridge" => has_bridge = true,
            "--profile" => {
                profile = match words.next() {
                    Some("dev") => Profile::Dev,
                    Some("release") => Profile::Release,
                    _ => return Err("--profile: dev or release".into()),
                }
            }
            other => return Err(format!("`{other}`: cargo xtask release takes --profile dev and --bridge")),
        }
    }
    run(profile, has_bridge).map(|()| ExitCode::SUCCESS)
}

/// Builds, packs, installs and tries.
pub(crate) fn run(profile: Profile, has_bridge: bool) -> Result<(), Failure> {
    build(profile, has_bridge)?;
    let dist = cargo::target().join("dist");
    empty_folder(&dist)?;
    // What is on the way there, and where it is tried.
    let work = dist.join("work");
    let tree = tree::lay(profile, has_bridge, &work.join("tree"))?;
    let packed = packages::pack(profile, &tree, &dist)?;
    trial::in_an_empty_root(&packed.debian, &tree, &work.join("root"))?;
    trial::in_a_fresh_venv(&packed.wheel, &work.join("venv"))?;
    for file in [&packed.debian, &packed.tarball, &packed.wheel] {
        println!("{:>6.1} MB  {}", megabytes(file)?, file.display());
    }
    Ok(())
}

fn megabytes(file: &Path) -> Result<f64, Failure> {
    let bytes = std::fs::metadata(file).map_err(|error| format!("{}: {error}", file.display()))?.len();
    Ok(bytes as f64 / 1e6)
}

/// Builds nothing anew that the tests have built, if by their profile: see `checks`. The example is there for Cargo,
/// which unites features with those that tests ask for only if it builds what tests could use.
fn build(profile: Profile, has_bridge: bool) -> Result<(), Failure> {
    let mut build = match profile {
        Profile::Dev => checked(&["build", "--workspace", "--lib", "--bin", "rohrpost", "--example", "own_view"]),
        Profile::Release => {
            checked(&["build", "--release", "--package", "rohrpost-cli", "--package", "rohrpost-python"])
        }
    };
    match (has_bridge, profile) {
        (true, Profile::Dev) => build.args(["--bin", BRIDGE]),
        (true, Profile::Release) => build.args(["--package", BRIDGE]),
        (false, _) => &mut build,
    };
    cargo::run("building the command and libraries", &mut build)?;
    // Optimised as a whole, which it is only without its Rust library.
    if profile == Profile::Release { c_client::build() } else { Ok(()) }
}
