//! Every input of the corpus once: fixed mistakes stay fixed. And a failing target is noticed.

use rohrpost_fuzz::{PLANTED, TARGETS, Target};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// One input; the slowest takes some hundredths of a second.
const PATIENCE: Duration = Duration::from_secs(60);

fn corpus(target: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    files
}

/// Runs an input on a thread of its own, with the usual stack. Returns its panic, or that it did not end.
fn run(target: Target, input: Vec<u8>) -> Result<(), String> {
    let (done, ended) = mpsc::channel();
    std::thread::spawn(move || {
        let end = catch_unwind(AssertUnwindSafe(|| (target.run)(&input)));
        let said = |panic: Box<dyn std::any::Any + Send>| {
            let text = panic.downcast_ref::<String>().cloned();
            text.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string)).unwrap_or_default()
        };
        let _ = done.send(end.map_err(said));
    });
    match ended.recv_timeout(PATIENCE) {
        Ok(end) => end,
        Err(RecvTimeoutError::Timeout) => Err(format!("no end within {PATIENCE:?}")),
        Err(RecvTimeoutError::Disconnected) => Err("its thread ended without a word".into()),
    }
}

#[test]
fn every_input_of_the_corpus_passes() {
    let mut failures = Vec::new();
    for target in TARGETS {
        let files = corpus(target.name);
        assert!(!files.is_empty(), "{}: no input", target.name);
        for file in files {
            if let Err(why) = run(target, fs::read(&file).unwrap()) {
                failures.push(format!("{}: {why}", file.display()));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn no_folder_of_the_corpus_is_forgotten() {
    let folders = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")).unwrap();
    for folder in folders {
        let name = folder.unwrap().file_name().into_string().unwrap();
        assert!(TARGETS.iter().any(|target| target.name == name), "corpus/{name} belongs to no target");
    }
}

#[test]
fn a_target_that_fails_is_noticed() {
    assert_eq!(run(PLANTED, b"rohr?".to_vec()), Ok(()));
    assert_eq!(run(PLANTED, b"rohr! and more".to_vec()), Err("planted: the fuzzer has found it".into()));
}
