//! Statements of the documentation about files are true: README shows the very example, and the book has all its pages.

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
        ["benches", "cli", "config", "gui-bridge", "mailbox", "modules", "routers", "src", "tests", "xtask"]
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

/// A test's name, in any crate: words and numbers.
fn is_name_of_a_test(word: &str) -> bool {
    word.contains('_') && word.chars().all(|c| c == '_' || c.is_ascii_lowercase() || c.is_ascii_digit())
}

/// Tables of a page of the book that name the test of each row: the last column of those with this heading.
#[track_caller]
fn check_named_tests(page: &str, sources: &str, tables_expected: usize) {
    let mut tables = 0;
    let mut is_of_tests = false;
    for line in text(page).lines() {
        let Some(row) = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |")) else {
            is_of_tests = false;
            continue;
        };
        let last = row.rsplit(" | ").next().unwrap();
        if last == "test" {
            (is_of_tests, tables) = (true, tables + 1);
        } else if is_of_tests && !last.starts_with("---") {
            let named: Vec<&str> = last.split('`').skip(1).step_by(2).collect();
            assert!(!named.is_empty(), "{page} names no test: {row}");
            for test in named {
                assert!(is_name_of_a_test(test), "{page}: `{test}` is no name of a test: {row}");
                let before = sources.split(&format!("fn {test}(")).next().filter(|before| before.len() < sources.len());
                let attributes = before.and_then(|before| before.rsplit("\n\n").next()).unwrap_or_default();
                // Some are called by a test that checks whether mistakes make them fail.
                let is_run =
                    attributes.contains("#[test]") || before.is_some() && sources.contains(&format!("::{test},"));
                assert!(is_run, "{page} names the test `{test}`, and there is none: {row}");
            }
        }
    }
    assert_eq!(tables, tables_expected, "tables of {page} that name tests");
}

#[test]
fn each_promise_names_tests_that_there_are() {
    let sources = sources();
    // The shares, the promises, and those of time slots.
    check_named_tests("docs/src/security.md", &sources, 3);
    check_named_tests("docs/src/why.md", &sources, 1);
}

/// The names by which links find the headings of a page, as mdBook makes them.
fn anchors(page: &str) -> BTreeSet<String> {
    let outside_of_blocks = page.split("\n```").step_by(2).flat_map(str::lines);
    let headings =
        outside_of_blocks.filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let of_a_name = |c: &char| c.is_alphanumeric() || ['_', '-', ' '].contains(c);
    headings.map(|text| text.to_lowercase().chars().filter(of_a_name).collect::<String>().replace(' ', "-")).collect()
}

#[test]
fn links_between_pages_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let book = fs::read_dir(root.join("docs/src")).unwrap().map(|entry| entry.unwrap().path());
    let pages = book.chain(["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|name| root.join(name)));
    for page in pages.filter(|page| page.extension().is_some_and(|extension| extension == "md")) {
        let text = fs::read_to_string(&page).unwrap();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.contains("://")) {
            let (file, anchor) = link.split_once('#').map_or((link, None), |(file, anchor)| (file, Some(anchor)));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(target.exists(), "{} links {link}, which does not exist", page.display());
            let Some(anchor) = anchor else { continue };
            let known = anchors(&fs::read_to_string(target).unwrap());
            assert!(known.contains(anchor), "{} links {link}, and there is no such heading: {known:?}", page.display());
        }
    }
}
