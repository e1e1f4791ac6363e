//! What the documentation says about files is so: README shows the very example, and the book has all its pages.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The code blocks of a page that begin with this fence, without the fences.
fn blocks(page: &str, fence: &str) -> Vec<String> {
    let open = format!("\n```{fence}\n");
    let parts = page.split(&open).skip(1);
    parts.map(|part| format!("{}\n", part.split("\n```").next().unwrap())).collect()
}

#[test]
fn readme_shows_the_example_that_is_compiled() {
    let example = text("examples/compass.rs");
    assert!(example.lines().count() <= 60, "a first module fits on a screen");
    assert!(
        blocks(&text("README.md"), "rust").contains(&example),
        "README.md has no ```rust block that equals examples/compass.rs; copy the file there"
    );
}

#[test]
fn the_book_has_all_its_pages() {
    let summary = text("docs/src/SUMMARY.md");
    let linked: BTreeSet<String> = summary
        .split("](")
        .skip(1)
        .map(|rest| rest.split(')').next().unwrap().trim_start_matches("./").to_owned())
        .collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let pages: BTreeSet<String> = files.filter(|name| name.ends_with(".md") && name != "SUMMARY.md").collect();
    assert_eq!(linked, pages, "left: what docs/src/SUMMARY.md links, right: what is in docs/src");
}

/// All Rust of the repository, below these folders.
fn sources() -> String {
    let mut folders: Vec<_> =
        ["benches", "config", "gui-bridge", "mailbox", "modules", "routers", "src", "tests", "xtask"]
            .map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
            .into();
    let mut all = String::new();
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                all += &fs::read_to_string(path).unwrap();
            }
        }
    }
    all
}

#[test]
fn each_promise_of_security_names_tests_that_there_are() {
    let page = text("docs/src/security.md");
    let sources = sources();
    let rows = page.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| ---"));
    let words = rows.flat_map(|row| row.split('`').skip(1).step_by(2));
    let is_test =
        |word: &&str| word.matches('_').count() > 2 && word.chars().all(|c| c == '_' || c.is_ascii_lowercase());
    let named: BTreeSet<&str> = words.filter(is_test).collect();
    assert!(named.len() > 50, "the page's tables are read no more: {named:?}");
    for test in named {
        assert!(
            sources.contains(&format!("fn {test}(")),
            "docs/src/security.md names the test `{test}`, and there is none"
        );
    }
}

#[test]
fn links_between_pages_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let book = fs::read_dir(root.join("docs/src")).unwrap().map(|entry| entry.unwrap().path());
    let pages = book.chain(["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|name| root.join(name)));
    for page in pages.filter(|page| page.extension().is_some_and(|extension| extension == "md")) {
        let text = fs::read_to_string(&page).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next()) {
            let local = !target.is_empty() && !target.contains("://");
            let there = !local || page.parent().unwrap().join(target).exists();
            assert!(there, "{} links {target}, which does not exist", page.display());
        }
    }
}
