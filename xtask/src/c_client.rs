//! `cargo xtask c-client`: the library for C and C++, installed where their compilers look.

use crate::cargo;
use crate::failure::Failure;
use crate::files::{copy_into, read, write};
use std::path::Path;
use std::process::ExitCode;

/// What C includes.
const HEADERS: [&str; 3] = ["rohrpost.h", "rohrpost.hpp", "rohrpost_types.h"];

/// Builds the library and installs it below a folder.
pub(crate) fn install(args: &[String]) -> Result<ExitCode, Failure> {
    let [prefix] = args else {
        return Err("cargo xtask c-client takes the folder to install into, such as /usr/local".into());
    };
    let prefix = std::path::absolute(prefix).map_err(|error| format!("{prefix}: {error}"))?;
    build()?;
    let built = cargo::target().join("release");
    place(&built, &["librohrpost_c.so", "librohrpost_c.a"], &prefix, &prefix.to_string_lossy())?;
    println!("installed below {}; compilers find it by: pkg-config --cflags --libs rohrpost", prefix.display());
    Ok(ExitCode::SUCCESS)
}

/// Builds the shared and the static library, optimised.
pub(crate) fn build() -> Result<(), Failure> {
    // Without Rust's own kind of library, beside which nothing is optimised as a whole.
    let build = ["rustc", "--release", "--package", "rohrpost-c", "--lib", "--crate-type", "cdylib,staticlib"];
    cargo::run("building the library for C", &mut cargo::cargo(&build))
}

/// Puts headers, built libraries and their description below a folder, which the description calls `prefix`.
pub(crate) fn place(built: &Path, libraries: &[&str], folder: &Path, prefix: &str) -> Result<(), Failure> {
    let source = cargo::root().join("clients/c");
    for header in HEADERS {
        copy_into(&source.join("include").join(header), &folder.join("include"))?;
    }
    for library in libraries {
        copy_into(&built.join(library), &folder.join("lib"))?;
    }
    let template = read(&source.join("rohrpost.pc.in"))?;
    let text = template.replace("@PREFIX@", prefix).replace("@VERSION@", env!("CARGO_PKG_VERSION"));
    write(&folder.join("lib/pkgconfig/rohrpost.pc"), &text)
}
