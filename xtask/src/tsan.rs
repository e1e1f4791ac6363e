//! `cargo xtask tsan`: the slot core and its broken variants under ThreadSanitizer (see `mailbox/proof/threads`).
//!
//! The stable toolchain includes ThreadSanitizer's library, but enables it only with `RUSTC_BOOTSTRAP`. That is set
//! for this build alone.

use crate::cargo::{self, cargo, host};
use crate::failure::Failure;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode};

const PACKAGE: &str = "rohrpost-proof-threads";
/// The standard library was built without it; the crate's first comment says why that does no harm.
const FLAGS: &str = "-Zsanitizer=thread -Cunsafe-allow-abi-mismatch=sanitizer";

/// Builds and checks.
pub(crate) fn run() -> Result<ExitCode, Failure> {
    let host = host()?;
    if !has_sanitizer(&host)? {
        return Err(format!(
            "this toolchain has no ThreadSanitizer for {host}; Rust's own one for x86-64 Linux has: rustup toolchain \
             install stable"
        ));
    }
    let target = cargo::target().join("tsan");
    let mut build = cargo(&["build", "--package", PACKAGE, "--target", &host]);
    build.env("CARGO_TARGET_DIR", &target).env("RUSTC_BOOTSTRAP", "1").env("RUSTFLAGS", FLAGS);
    cargo::run("building the slot core with ThreadSanitizer", &mut build)?;
    let mut program = Command::new(target.join(host).join("debug").join(PACKAGE));
    cargo::run("running it, and what is broken, under ThreadSanitizer", &mut program)?;
    Ok(ExitCode::SUCCESS)
}

fn has_sanitizer(host: &str) -> Result<bool, Failure> {
    let output =
        Command::new("rustc").args(["--print", "sysroot"]).output().map_err(|error| format!("rustc: {error}"))?;
    let root = String::from_utf8_lossy(&output.stdout);
    let folder = Path::new(root.trim()).join("lib/rustlib").join(host).join("lib");
    let files = fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    Ok(files.flatten().any(|file| file.file_name().to_string_lossy().ends_with("_rt.tsan.a")))
}
