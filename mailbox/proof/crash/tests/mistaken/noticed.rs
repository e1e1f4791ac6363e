//! What all scenes together show.

use crate::catalog::MISTAKES;
use rohrpost_planted::all_pass_without_a_mistake;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The crash points of this source: line and name.
fn steps(source: &str) -> impl Iterator<Item = (usize, &str)> {
    source.lines().enumerate().filter_map(|(at, line)| {
        let (step, _) = line.trim_start().strip_prefix("step!(\"")?.split_once('"')?;
        Some((at + 1, step))
    })
}

/// Those that nothing died at, each with its place.
fn survived(file: &str, source: &str, died: &BTreeSet<&str>) -> Vec<String> {
    let survived = steps(source).filter(|(_, step)| !died.contains(step));
    survived.map(|(line, step)| format!("mailbox/src/{file}:{line}: {step}")).collect()
}

/// The files of a folder, and of those in it.
fn files(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn without_a_mistake_all_scenes_pass_and_die_at_every_step() {
    let said = all_pass_without_a_mistake();
    let died: BTreeSet<&str> = said.lines().filter_map(|line| Some(line.split_once("died at ")?.1)).collect();
    let (mut written, mut named, mut missed) = (0, BTreeSet::new(), Vec::new());
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../src");
    for path in files(&folder) {
        let file = path.strip_prefix(&folder).unwrap().to_str().unwrap();
        let source = std::fs::read_to_string(&path).unwrap();
        written += source.matches("step!(").count();
        named.extend(steps(&source).map(|(_, step)| step.to_owned()));
        missed.extend(survived(file, &source, &died));
    }
    assert!(missed.is_empty(), "no scene dies at\n{}", missed.join("\n"));
    // Of two with one name, the other would hide that one is never died at.
    assert_eq!(named.len(), written, "each `step!` has a line and a name of its own: {named:#?}");
}

#[test]
fn a_step_that_no_scene_dies_at_is_named() {
    let source = "fn claim() {\n    step!(\"claim: before\");\n    step!(\"claim: new\");\n}\n";
    let died = BTreeSet::from(["claim: before"]);
    assert_eq!(survived("slots/protocol.rs", source, &died), ["mailbox/src/slots/protocol.rs:3: claim: new"]);
}

#[test]
fn each_check_of_the_aftermath_fails_with_a_mistake() {
    let aftermath = include_str!("../crash/aftermath.rs");
    let checks: BTreeSet<&str> =
        aftermath.split("Check::").skip(1).filter_map(|rest| rest.split_once('.')).map(|(check, _)| check).collect();
    let said: BTreeSet<&str> = MISTAKES.iter().filter_map(|mistake| mistake.says.strip_prefix("check ")).collect();
    let cannot_fail: Vec<_> = checks.difference(&said).collect();
    assert!(cannot_fail.is_empty() && checks.len() > 10, "no mistake is noticed by {cannot_fail:?}");
}
