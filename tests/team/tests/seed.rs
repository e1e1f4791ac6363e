//! The seed's tests (seed 000, 5.1) in virtual time: each file in `config/team/` is as expected.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_virtual_team::scenario::{NoScenario, Scenario};
use std::path::{Path, PathBuf};

fn scenarios() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/team");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|it| it == "toml")).collect();
    files.sort();
    assert!(files.len() >= 3, "{files:?}");
    files
}

#[test]
fn the_seeds_tests_end_as_expected() {
    let mut wrong = Vec::new();
    for path in scenarios() {
        let scenario = Scenario::read(&path).unwrap_or_else(|error| panic!("{error}"));
        for seed in 0..3 {
            let verdict = scenario.run(seed);
            println!("{} seed {seed}: {verdict}", path.display());
            if !verdict.wrong.is_empty() {
                wrong.push(format!("{} seed {seed}: {verdict}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_file_that_is_no_scenario_is_told_with_its_place() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scenarios");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("two.map"), "***\n*.*\n").unwrap();
    let head = "map = \"two.map\"\nfacing = \"west\"\ncoordination = false\nseconds = 1\n[expected]\nseed = \"-\"\n";
    let told = |text: &str| {
        let path = folder.join("one.toml");
        std::fs::write(&path, text).unwrap();
        Scenario::read(&path).map(drop).map_err(|error: NoScenario| error.to_string())
    };
    assert_eq!(told(head), Ok(()));
    for (text, words) in [
        (head.replace("two.map", "no.map"), "no.map: No such file"),
        (head.replace("west", "up"), "unknown variant `up`, expected one of"),
        (head.replace("seconds", "secs"), "unknown field `secs`"),
        (
            format!("{head}[payload-killed]\nrobot = 1\nat-s = 1\nrestarts = true\n"),
            "`payload-killed` names robot 1, but the map draws robots 1 to 0",
        ),
    ] {
        let error = told(&text).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}
