//! All texts of the crate, word for word: every mistake in `tests/broken`, and the meaning of the shipped files.
//!
//! `UPDATE_GOLDEN=1 cargo test -p rohrpost-config` writes the expected texts anew; read the difference before you
//! commit.

use rohrpost_config::{Installation, explain};
use std::fs;
use std::path::{Path, PathBuf};

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Compares with a golden file, or writes it; returns what differs.
fn check(golden: &Path, said: &str) -> Option<String> {
    let said = format!("{}\n", said.trim_end());
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(golden, &said).expect("golden files can be written");
        return None;
    }
    let expected = fs::read_to_string(golden).unwrap_or_default();
    (said != expected).then(|| format!("{}\n--- expected\n{expected}--- said\n{said}", golden.display()))
}

#[test]
fn every_mistake_gets_its_message() {
    let files = fs::read_dir(folder().join("tests/broken")).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    files.sort();
    assert!(files.len() >= 20, "only {} broken files", files.len());
    let mut wrong = Vec::new();
    for path in files {
        let name = Path::new(path.file_name().unwrap());
        match Installation::parse(&fs::read_to_string(&path).unwrap(), name) {
            Ok(_) => wrong.push(format!("{}: nothing was found wrong with it", path.display())),
            Err(errors) => wrong.extend(check(&path.with_extension("txt"), &errors.to_string())),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_that_ship_load_and_explain_themselves() {
    for file in [
        "demo.toml",
        "demo-log.toml",
        "demo-nodes.toml",
        "demo-tdma.toml",
        "demo-tcp.toml",
        "tests/tdma.toml",
        "tests/tcp.toml",
        "tests/team.toml",
        "tests/beyond.toml",
        "tests/record.toml",
        "tests/replica.toml",
        "tests/replica-slots.toml",
        "tests/full.toml",
        "tests/standby.toml",
    ] {
        let text = fs::read_to_string(folder().join(file)).unwrap();
        let installation = Installation::parse(&text, Path::new(file)).unwrap_or_else(|errors| panic!("{errors}"));
        let page = explain(&installation, None);
        let wide: Vec<&str> = page.lines().filter(|line| line.chars().count() > 100).collect();
        assert!(wide.is_empty(), "wider than 100 columns: {wide:#?}");
        let golden = Path::new(file).with_extension("explained.txt");
        let golden = folder().join("tests/explained").join(golden.file_name().unwrap());
        if let Some(difference) = check(&golden, &page) {
            panic!("{difference}");
        }
    }
}

/// A missing program is an error on the node that runs it, and on no other.
#[test]
fn programs_that_are_not_here_are_named_for_their_node() {
    let text = fs::read_to_string(folder().join("tests/programs.toml")).unwrap();
    let installation =
        Installation::parse(&text, Path::new("programs.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let mut said = String::new();
    for node in &installation.nodes {
        for program in installation.missing_programs(&node.name, Path::new("/nowhere")) {
            said += &format!("{}: {program}\n", node.name);
        }
    }
    if let Some(difference) = check(&folder().join("tests/explained/programs.txt"), &said) {
        panic!("{difference}");
    }
}

/// `full.toml` has every key there is (`every_key_arrives`), so a key that it has and the manual has not was forgotten.
#[test]
fn manual_names_every_key_and_its_example_loads() {
    let manual = fs::read_to_string(folder().join("../docs/src/configuration.md")).unwrap();
    let read = |file: &str| fs::read_to_string(folder().join("tests").join(file)).unwrap();
    let (full, tcp, record) = (read("full.toml"), read("tcp.toml"), read("record.toml"));
    let team = read("team.toml");
    let team = team.split_once("[team]").unwrap().1.split_once("[gui]").unwrap().0;
    let replica = read("replica.toml");
    let replicated = replica.split_once("\n[[replica]]\n").unwrap().1;
    let modules = full.split_once("[[module]]").unwrap().1;
    let beyond = tcp.split_once("[tcp]").unwrap().1;
    let recorded = record.split_once("\n[record]\n").unwrap().1;
    let keys = modules
        .lines()
        .chain(beyond.lines())
        .chain(team.lines())
        .chain(recorded.lines())
        .chain(replicated.lines())
        .filter(|line| !line.starts_with("settings"))
        .filter_map(|line| line.split_once(" = "));
    for (key, _) in keys {
        assert!(manual.contains(&format!("`{key}`")) || manual.contains(&format!(".{key}]`")), "no word on `{key}`");
    }
    let example = manual.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    Installation::parse(example, Path::new("configuration.md")).unwrap_or_else(|errors| panic!("{errors}"));
}
