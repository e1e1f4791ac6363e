//! `cargo xtask c-client`: the library for C and C++, installed where their compilers look.

use crate::cargo;
use crate::failure::Failure;
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
    // Without Rust's own kind of library, beside which nothing is optimised as a whole.
    let build = ["rustc", "--release", "--package", "rohrpost-c", "--lib", "--crate-type", "cdylib,staticlib"];
    cargo::run("building the library for C", &mut cargo::cargo(&build))?;
    let (source, built) = (cargo::root().join("clients/c"), cargo::target().join("release"));
    let [headers, libraries] = ["include", "lib"].map(|folder| prefix.join(folder));
    let descriptions = libraries.join("pkgconfig");
    for header in HEADERS {
        copy(&source.join("include").join(header), &headers)?;
    }
    for library in ["librohrpost_c.so", "librohrpost_c.a"] {
        copy(&built.join(library), &libraries)?;
    }
    let template = read(&source.join("rohrpost.pc.in"))?;
    let text = template.replace("@PREFIX@", &prefix.to_string_lossy()).replace("@VERSION@", env!("CARGO_PKG_VERSION"));
    let description = descriptions.join("rohrpost.pc");
    let written = std::fs::create_dir_all(&descriptions).and_then(|()| std::fs::write(&description, text));
    written.map_err(|error| format!("{}: {error}", description.display()))?;
    println!("installed below {}; compilers find it by: pkg-config --cflags --libs rohrpost", prefix.display());
    Ok(ExitCode::SUCCESS)
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

fn copy(file: &Path, folder: &Path) -> Result<(), Failure> {
    let copied = std::fs::create_dir_all(folder).and_then(|()| {
        let target = folder.join(file.file_name().unwrap_or_default());
        // A library that runs is replaced by another, not changed.
        let _ = std::fs::remove_file(&target);
        std::fs::copy(file, target)
    });
    copied.map(drop).map_err(|error| format!("{} into {}: {error}", file.display(), folder.display()))
}
