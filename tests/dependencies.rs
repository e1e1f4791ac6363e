//! Third-party crates: none of a tool for the author of a module, no licence that asks for more than attribution, and
//! none in two versions without a reason.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// Each of these may be used, also in closed software.
const LICENCES: [&str; 9] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "MIT",
    "Unicode-3.0",
    "Zlib",
];

/// Crates in two versions, with the reason.
const DOUBLED: [(&str, &str); 7] = [
    ("darling", "mcap's enumset stays at 0.21, ratatui's macros take 0.24; only the compiler runs them"),
    ("darling_core", "the same"),
    ("darling_macro", "the same"),
    ("getrandom", "ring 0.17 stays at 0.2, tempfile takes 0.4"),
    ("rand_core", "rand 0.9 stays at 0.9, getrandom 0.4 as proptest asks for it takes 0.10"),
    ("signal-hook", "crossterm 0.29, the terminal of `top`, stays at 0.3"),
    ("syn", "clap_derive takes 3, all other macros 2; only the compiler runs them"),
];

/// Our tools, or crates that only tools need.
const NOT_FOR_MODULES: [&str; 22] = [
    "clap",
    "comfy-table",
    "flate2",
    "humantime",
    "mcap",
    "pyo3",
    "rand",
    "ratatui",
    "rcgen",
    "rerun",
    "rohrpost-bench",
    "rohrpost-bench-local",
    "rohrpost-builtin",
    "rohrpost-bundle",
    "rohrpost-launch",
    "rohrpost-native",
    "rohrpost-recording",
    "rohrpost-robot",
    "rohrpost-router-daemon",
    "rohrpost-team",
    "rustls",
    "serde_json",
];
/// The bench and its peers, and the own dependencies of the GUI bridge and of the package in Python.
const NOT_FOR_THE_COMMAND: [&str; 5] = ["iceoryx2", "pyo3", "rerun", "rohrpost-bench", "zenoh"];

struct Crate {
    name: String,
    version: String,
    licence: String,
}

/// All that is compiled for a package of ours, including itself.
fn compiled_for(package: &str) -> Vec<Crate> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["tree", "--package", package, "--edges", "normal,build", "--prefix", "none", "--format", "{p}|{l}"]);
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines: BTreeSet<String> = String::from_utf8(output.stdout).unwrap().lines().map(String::from).collect();
    let read = |line: &String| {
        let (what, licence) = line.split_once('|')?;
        let mut words = what.split(' ');
        let (name, version) = (words.next()?.into(), words.next()?.into());
        // A repeated line has a star and no dependencies below it.
        Some(Crate { name, version, licence: licence.trim_end_matches(" (*)").into() })
    };
    lines.iter().filter_map(read).collect()
}

/// Whether the licence allows use: one alternative of each part joined by AND must be among [`LICENCES`].
fn is_free(expression: &str) -> bool {
    let one_of = |choice: &str| {
        let choice = choice.trim_matches(['(', ')']).replace('/', " OR ");
        choice.split(" OR ").any(|licence| LICENCES.contains(&licence.trim()))
    };
    expression.split(" AND ").all(one_of)
}

#[test]
fn each_licence_may_be_used_and_nothing_comes_twice_without_a_reason() {
    assert!(is_free("(MIT OR Apache-2.0) AND Unicode-3.0") && is_free("Apache-2.0/MIT") && is_free("GPL-3.0 OR MIT"));
    assert!(!is_free("GPL-3.0") && !is_free("MIT AND GPL-3.0") && !is_free(""));
    let all = compiled_for("rohrpost-cli");
    assert!(all.len() > 100, "cargo tree is read no more: {}", all.len());
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for its in &all {
        assert!(is_free(&its.licence), "{} {} is under `{}`", its.name, its.version, its.licence);
        versions.entry(&its.name).or_default().insert(&its.version);
    }
    let doubled: BTreeSet<&str> = versions.iter().filter(|(_, all)| all.len() > 1).map(|(name, _)| *name).collect();
    assert_eq!(doubled, DOUBLED.iter().map(|(name, _)| *name).collect(), "left: what comes twice, right: why");
}

#[test]
fn the_author_of_a_module_compiles_no_tool() {
    for (package, unwanted) in [("rohrpost", &NOT_FOR_MODULES[..]), ("rohrpost-cli", &NOT_FOR_THE_COMMAND)] {
        let all = compiled_for(package);
        assert!(all.iter().any(|its| its.name == package));
        let found: Vec<&str> = all.iter().map(|its| its.name.as_str()).filter(|name| unwanted.contains(name)).collect();
        assert!(found.is_empty(), "{package} also compiles {found:?}");
    }
}

/// Crates that Cargo compiles for what these arguments select, each with the sets of features that it is compiled with:
/// one for the programs and one for macros, if they differ.
fn features_for(selection: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["tree", "--prefix", "none", "--format", "{p}|{f}"]).args(selection);
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        // Between the crates stand lines such as `[dev-dependencies]`.
        let Some((what, features)) = line.trim_end_matches(" (*)").split_once('|') else { continue };
        // `name v1.2.3`; behind it stands where it is, or that it is a macro.
        let what = what.split(' ').take(2).collect::<Vec<_>>().join(" ");
        all.entry(what).or_default().insert(features.into());
    }
    all
}

/// Cargo compiles a crate once more for each set of features, and with it all that needs it.
#[test]
fn demo_build_example_and_test_compile_no_crate_twice() {
    let test = features_for(&["--edges", "all"]);
    for (command, selection) in [
        ("cargo demo", &["--edges", "normal,build", "--package", "rohrpost-cli"][..]),
        ("cargo build", &["--edges", "normal,build"]),
        (
            "cargo xtask test",
            &[
                "--edges=all",
                "--workspace",
                "--exclude=rohrpost-gui-bridge",
                "--exclude=rohrpost-bench",
                "--exclude=rohrpost-proof-loom",
                "--exclude=rohrpost-proof-supervision",
                "--exclude=rohrpost-proof-team",
            ],
        ),
    ] {
        let all = features_for(selection);
        assert!(all.len() > 100, "cargo tree is read no more: {}", all.len());
        let differ: Vec<_> = all
            .iter()
            .filter_map(|(name, sets)| Some((name, sets, test.get(name)?)))
            .filter(|(_, sets, tested)| !sets.is_subset(tested))
            .collect();
        assert!(differ.is_empty(), "features for `{command}`, then for `cargo test`: {differ:#?}");
    }
}

fn manifest(folder: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join("Cargo.toml");
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Folders of all packages, the root's `.` first.
fn packages() -> Vec<String> {
    let workspace = manifest(".");
    let members = workspace.split_once("members = [").unwrap().1.split_once(']').unwrap().0;
    let members = members.split('"').skip(1).step_by(2);
    [".".to_owned()].into_iter().chain(members.map(String::from)).collect()
}

/// Names of packages in a section.
fn named(manifest: &str, section: &str) -> Vec<String> {
    let lines = manifest.lines().skip_while(|line| *line != section).skip(1).take_while(|line| !line.starts_with('['));
    lines.filter_map(|line| line.split(['.', ' ', '=']).next()).map(String::from).collect()
}

#[test]
fn the_picture_of_the_crates_is_what_their_manifests_say() {
    let manifests: BTreeMap<String, String> =
        packages().into_iter().map(|folder| (folder.clone(), manifest(&folder))).collect();
    let name = |manifest: &str| {
        let line = manifest.split_once("[package]\nname = \"").unwrap().1;
        line.split('"').next().unwrap().to_owned()
    };
    let folders: BTreeMap<String, &String> =
        manifests.iter().map(|(folder, manifest)| (name(manifest), folder)).collect();
    let arrows = manifests.iter().map(|(folder, manifest)| {
        let needed =
            named(manifest, "[dependencies]").into_iter().filter_map(|name| Some((*folders.get(&name)?).clone()));
        (folder.clone(), needed.collect::<BTreeSet<_>>())
    });
    // Proofs compile the slot core itself, and need none of our packages.
    let said: BTreeMap<_, _> = arrows.filter(|(folder, _)| !folder.starts_with("mailbox/proof")).collect();
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("ARCHITECTURE.md")).unwrap();
    let picture = page.split_once("```text\nmailbox\n").unwrap().1.split_once("```").unwrap().0;
    let drawn = ["mailbox"].into_iter().chain(picture.lines()).map(|line| {
        let (from, to) = line.split_once("─▶").unwrap_or((line, ""));
        let to = to.trim().split("  ").next().unwrap_or_default();
        let to = to.split(", ").filter(|to| !to.is_empty()).map(String::from);
        (from.trim().to_owned(), to.collect::<BTreeSet<_>>())
    });
    assert_eq!(drawn.collect::<BTreeMap<_, _>>(), said, "left: ARCHITECTURE.md, right: the manifests");
}

/// Where a newcomer looks first: short, with each package, and it names no folder that does not exist.
#[test]
fn the_map_is_short_and_has_each_package() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let words = page.split_whitespace().count();
    assert!(words <= 3000, "ARCHITECTURE.md has {words} words; what is over 3 000 belongs in the book");
    let rows = page.split_once("| folder | what | invariant |\n").unwrap().1.lines().skip(1);
    let rows: Vec<_> = rows.take_while(|line| line.starts_with('|')).collect();
    let folder = |row: &&str| row.strip_prefix("| `")?.split_once("/` |").map(|(folder, _)| folder.to_owned());
    let folders: BTreeSet<String> = rows.iter().filter_map(folder).collect();
    assert_eq!(folders.len(), rows.len(), "a row begins with a folder, which stands there once");
    let missing: Vec<_> = folders.iter().filter(|folder| !root.join(folder).is_dir()).collect();
    assert!(missing.is_empty(), "ARCHITECTURE.md has rows for folders that there are not: {missing:?}");
    let untold: Vec<_> = packages().into_iter().map(|it| if it == "." { "src".into() } else { it }).collect();
    let untold: Vec<_> = untold.iter().filter(|package| !folders.contains(*package)).collect();
    assert!(untold.is_empty(), "ARCHITECTURE.md has no row for these packages: {untold:?}");
}

/// Each package's `Cargo.toml` has a true description; public ones must have one.
#[test]
fn each_package_says_what_it_is() {
    let all = packages();
    assert!(all.len() > 10, "{all:?}");
    for folder in all {
        let manifest = manifest(&folder);
        let package = manifest.split_once("[package]").unwrap().1;
        let is_ours_alone = manifest.contains("\npublish = false");
        let keys = ["name", "description", "version", "license", "rust-version"];
        for key in keys.into_iter().filter(|_| !is_ours_alone) {
            assert!(package.contains(&format!("\n{key}")), "{folder}/Cargo.toml has no `{key}`");
        }
        assert!(!manifest.contains("example."), "{folder}/Cargo.toml names a place that there is not");
    }
}
