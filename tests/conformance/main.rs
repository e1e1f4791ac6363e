//! The conformance suite's cases, and Rust under it.
//!
//! `cases.rs` makes the files in `cases/` with the crates themselves: values by serde and postcard, not by the walker
//! that clients in Rust have. A file that Rust does not reproduce fails; `UPDATE_GOLDEN=1` writes it anew. `client.rs`
//! is a client that answers the suite's questions, as one in any other language does; `run.py` asks it all cases.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod cases;
mod client;
mod types;

use serde_json::Value as Json;
use std::path::{Path, PathBuf};
use std::process::Command;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/conformance")
}

#[test]
fn each_file_of_cases_is_what_rust_makes() {
    for (name, made) in cases::files() {
        let file = folder().join("cases").join(format!("{name}.json"));
        // One case a line, so that a change shows what it changes.
        let lines: Vec<String> = made.iter().map(Json::to_string).collect();
        let text = format!("[\n{}\n]\n", lines.join(",\n"));
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&file, &text).unwrap();
        }
        let there = std::fs::read_to_string(&file).unwrap_or_default();
        let there: Vec<Json> = serde_json::from_str(&there).unwrap_or_default();
        assert_eq!(there, made, "{}: left the file, right the code; UPDATE_GOLDEN=1 writes it", file.display());
    }
}

/// Runs the suite's cases that need no server against a client.
fn run(client: &[&str]) {
    let mut command = Command::new("python3");
    // Beside the sources nothing is to be written.
    command.arg("-B").arg(folder().join("run.py")).args(["--words", "--"]).args(client);
    let said = command.env("ROHRPOST_CONFORMANCE", "1").output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&said.stdout), String::from_utf8_lossy(&said.stderr));
    assert!(said.status.success(), "{out}\n{err}");
    assert!(out.starts_with("conforms: "), "{out}\n{err}");
}

#[test]
fn rust_conforms() {
    let me = std::env::current_exe().unwrap();
    run(&[me.to_str().unwrap(), "--exact", "client", "--nocapture"]);
}

#[test]
fn python_conforms() {
    let client = folder().join("client.py");
    run(&["python3", "-B", client.to_str().unwrap()]);
}

#[test]
fn python_passes_its_own_tests() {
    let package = folder().join("../../clients/python");
    let mut command = Command::new("python3");
    command.args(["-B", "-m", "unittest", "discover", "-t", ".", "-s", "tests"]).current_dir(&package);
    let said = command.env("PYTHONPATH", package.join("src")).output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
}

/// Not a test: the client in Rust, which the suite starts. Run as a test it ends at once.
#[test]
fn client() {
    if std::env::var_os("ROHRPOST_CONFORMANCE").is_some() {
        client::answer_all();
    }
}
