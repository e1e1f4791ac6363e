//! The programs in C beside this, compiled as their users do, and run: plain, under AddressSanitizer, and by valgrind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_test_report::skipped;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A way to compile: a compiler, and what it is told.
const WAYS: [(&str, &[&str]); 5] = [
    ("gcc", &["-std=c11"]),
    ("gcc", &["-std=c11", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]),
    ("g++", &["-std=c++17", "-x", "c++"]),
    ("clang", &["-std=c11"]),
    ("clang++", &["-std=c++17", "-x", "c++"]),
];

fn is_there(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Compiles a program of this folder with warnings as errors, linked with the shared library of this build.
fn compiled(folder: &Path, (compiler, options): (&str, &[&str]), source: &str) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = folder.join("program");
    // target/debug/deps, where Cargo has put it.
    let library = std::env::current_exe().unwrap().parent().unwrap().to_owned();
    let output = Command::new(compiler)
        .args(["-Wall", "-Wextra", "-Werror", "-pthread", "-D_GNU_SOURCE"])
        .args(options)
        .arg(here.join("tests").join(source))
        .arg("-I")
        .arg(here.join("include"))
        .arg("-o")
        .arg(&program)
        .arg("-L")
        .arg(&library)
        .arg(format!("-Wl,-rpath,{}", library.display()))
        .args(["-x", "none", "-lrohrpost_c", "-lm"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{compiler} {options:?}: {}", String::from_utf8_lossy(&output.stderr));
    program
}

/// Runs it with a directory for a node of its own.
fn runs(mut command: Command, folder: &Path) {
    let node = folder.join("node");
    let output = command.arg(&node).env_remove("ROHRPOST_CONFIG").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && output.stdout == b"all is well\n", "{command:?}: {output:?}\n{said}");
    let _ = std::fs::remove_dir_all(&node);
}

fn every_way(source: &str) {
    for way in WAYS {
        if !is_there(way.0) {
            skipped(&format!("C by {}, which is not there", way.0));
            continue;
        }
        // In shared memory, as a node is.
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let program = compiled(folder.path(), way, source);
        runs(Command::new(&program), folder.path());
    }
}

/// Every byte that is read was written, and every one is given back.
fn by_valgrind(source: &str) {
    if !is_there("valgrind") {
        skipped("C by valgrind, which is not there");
        return;
    }
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let program = compiled(folder.path(), ("gcc", &["-std=c11", "-g"]), source);
    let mut command = Command::new("valgrind");
    command.args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"]);
    command.arg(format!("--suppressions={}/tests/valgrind.supp", env!("CARGO_MANIFEST_DIR"))).arg(program);
    runs(command, folder.path());
}

#[test]
fn mailboxes_and_streams_in_c_and_in_c_plus_plus() {
    every_way("mailboxes.c");
}

#[test]
fn values_in_c_and_in_c_plus_plus() {
    every_way("values.c");
}

#[test]
fn mailboxes_and_streams_by_valgrind() {
    by_valgrind("mailboxes.c");
}

#[test]
fn values_by_valgrind() {
    by_valgrind("values.c");
}
