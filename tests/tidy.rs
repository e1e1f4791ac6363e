//! Rules for sources that no compiler checks: the files of a crate lie in layers, and a reader can keep each in mind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "tidy/node_files.rs"]
mod node_files;
#[path = "tidy/sources.rs"]
mod sources;
#[path = "tidy/syntax.rs"]
mod syntax;
#[path = "tidy/words.rs"]
mod words;

use sources::{Crate, find_crates};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Two files that name each other, and the reason.
const PAIRS: &[(&str, &str, &str)] = &[
    (
        "config/src/installation.rs",
        "config/src/saved.rs",
        "what is saved is a part of an installation, and is read and told by its names",
    ),
    ("gui-bridge/src/files.rs", "gui-bridge/src/sink.rs", "a sink is begun with a file, and both fail alike"),
    (
        "mailbox/src/node/directory.rs",
        "mailbox/src/wake/doorbell.rs",
        "bells are in the node's page, and a process that finds a death there rings them",
    ),
    (
        "mailbox/src/slots/hot.rs",
        "mailbox/src/slots/protocol.rs",
        "what both sides say is a part of the slot core, which the proofs take whole",
    ),
    (
        "modules/launch/src/launch/child.rs",
        "modules/launch/src/launch/child/ending.rs",
        "one state of a child, which changes the child",
    ),
    (
        "modules/launch/src/launch/mod.rs",
        "modules/launch/src/launch/start.rs",
        "one state of launch, which changes launch",
    ),
    (
        "modules/src/output/layer.rs",
        "modules/src/output/way.rs",
        "lines go the way, and the way's own lines come by the layer",
    ),
    (
        "routers/src/outbound/flows.rs",
        "routers/src/outbound/mod.rs",
        "a part of `Outbound`'s state, and the functions for it",
    ),
    ("routers/src/queue/mod.rs", "routers/src/queue/shares.rs", "a part of the queue's memory, by its places"),
    (
        "routers/src/shell/clock/mod.rs",
        "routers/src/shell/clock/runtime.rs",
        "what the thread of the clock does, and why it could not",
    ),
    ("routers/src/tcp/server/accept.rs", "routers/src/tcp/server/mod.rs", "lets connections in"),
    (
        "routers/src/session/server/mod.rs",
        "routers/src/session/server/places.rs",
        "a part of the server's state, and the functions for it",
    ),
    (
        "routers/src/time/clock.rs",
        "routers/src/time/clock/slots.rs",
        "what a clock remembers in time slots, and does there",
    ),
    ("tests/testbed/src/sim/plan/draw.rs", "tests/testbed/src/sim/plan/mod.rs", "a plan, and how its parts are drawn"),
    (
        "modules/launch/src/survey.rs",
        "modules/launch/src/survey/standing.rs",
        "a module at one moment, and in which state that is",
    ),
];

/// Type names that several files of a crate use, each for a type of its own, and the reason.
const SHARED_NAMES: &[(&str, &str, &str)] = &[
    ("cli/src", "Arguments", "each subcommand has its own, in a file of its name"),
    ("modules/builtin/src", "Settings", "each module has its own, as those of an author have"),
    ("modules/robot/src", "Settings", "each computation has its own, which its module's settings hold"),
    ("tests/fuzz/src", "World", "each target is a program of its own, and has one"),
];

/// Lines that a file may have.
const LINES_MAX: usize = 400;

/// Longer files that are still to be divided; they may only become shorter. Those of loom hold its models, and mistakes
/// as edits of text.
const LONG: &[(&str, usize)] = &[
    ("mailbox/proof/loom/src/models.rs", 642),
    ("mailbox/src/sender.rs", 425),
    ("mailbox/src/slots/protocol.rs", 423),
    ("modules/src/call/deduplicator_simulation.rs", 403),
    ("modules/src/output/way.rs", 438),
    ("modules/launch/tests/launch.rs", 404),
    ("routers/src/outbound/tests/mod.rs", 419),
    ("routers/src/time/clock.rs", 420),
    ("routers/src/time/clock/slots.rs", 437),
    ("routers/src/time/election.rs", 408),
    ("routers/tests/shell.rs", 410),
    ("tests/e2e/probe.rs", 405),
];

/// Words of the book and README together; bars of tables are none. The limit is to fall, to 60 000.
const WORDS_MAX: usize = 66_900;

#[test]
fn the_book_has_no_more_words_than_a_reader_has_time_for() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pages = vec![root.join("README.md")];
    find_files(&root.join("docs"), ".md", &mut pages);
    assert!(pages.len() > 20, "{pages:?}");
    let is_word = |word: &&str| word.contains(char::is_alphanumeric);
    let words_of = |page: &PathBuf| std::fs::read_to_string(page).unwrap().split_whitespace().filter(is_word).count();
    let words: usize = pages.iter().map(words_of).sum();
    assert!(
        words <= WORDS_MAX,
        "{words} words in docs and README.md, and {WORDS_MAX} are allowed: cut as many as you add"
    );
}

#[test]
fn files_are_no_longer_than_a_reader_can_hold_in_mind() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    find_files(root, ".rs", &mut files);
    assert!(files.len() > 500, "{}", files.len());
    let mut mistakes = Vec::new();
    for file in files {
        let lines = std::fs::read_to_string(&file).unwrap().lines().count();
        let name = file.strip_prefix(root).unwrap().to_str().unwrap();
        match LONG.iter().find(|(long, _)| *long == name) {
            Some((_, most)) if lines > *most => {
                mistakes.push(format!("{name} has {lines} lines and had {most}; divide it"))
            }
            Some(_) if lines <= LINES_MAX => mistakes.push(format!("{name} has {lines} lines; drop it from LONG")),
            None if lines > LINES_MAX => mistakes.push(format!("{name} has {lines} lines; divide it")),
            _ => {}
        }
    }
    for (long, _) in LONG.iter().filter(|(long, _)| !root.join(long).exists()) {
        mistakes.push(format!("{long} does not exist; drop it from LONG"));
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

#[test]
fn the_first_lines_of_each_folder_say_what_it_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    find_files(root, ".rs", &mut files);
    let heads = |file: &&PathBuf| {
        let name = file.file_name().unwrap().to_str().unwrap();
        ["lib.rs", "main.rs", "mod.rs"].contains(&name) || file.with_extension("").is_dir()
    };
    let heads: Vec<_> = files.iter().filter(heads).collect();
    assert!(heads.len() > 100, "{}", heads.len());
    let silent: Vec<_> =
        heads.into_iter().filter(|file| !std::fs::read_to_string(file).unwrap().starts_with("//! ")).collect();
    assert!(silent.is_empty(), "begin these with what they and their folders are: {silent:#?}");
}

/// All files of a folder with names that end so, but for what is built and hidden.
fn find_files(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() && !name.starts_with('.') && name != "target" {
            find_files(&path, ending, found);
        } else if name.ends_with(ending) {
            found.push(path);
        }
    }
}

#[test]
fn files_of_a_crate_do_not_name_each_other_in_circles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut crates = Vec::new();
    find_crates(root, &mut crates);
    assert!(crates.len() > 10, "{crates:?}");
    let mut mistakes = Vec::new();
    let mut pairs = BTreeSet::new();
    for source in &crates {
        let sources = Crate::read(source, root);
        for circle in sources.circles() {
            let said = match circle.as_slice() {
                [a, b] => pairs.insert((a.clone(), b.clone())) && PAIRS.iter().any(|(c, d, _)| c == a && d == b),
                _ => false,
            };
            if !said {
                mistakes.push(sources.explain(&circle));
            }
        }
    }
    for (a, b, _) in PAIRS.iter().filter(|(a, b, _)| !pairs.contains(&((*a).to_owned(), (*b).to_owned()))) {
        mistakes.push(format!("{a} and {b} do not name each other any more; drop them from PAIRS"));
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n\n"));
}

#[test]
fn one_type_name_is_one_thing_in_a_crate() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut crates, mut mistakes, mut found) = (Vec::new(), Vec::new(), BTreeSet::new());
    find_crates(root, &mut crates);
    for source in &crates {
        let folder = source.strip_prefix(root).unwrap().parent().unwrap().to_str().unwrap().to_owned();
        for (name, files) in Crate::read(source, root).shared_type_names() {
            match SHARED_NAMES.iter().find(|(of, shared, _)| *of == folder && shared == name) {
                Some((of, shared, _)) => drop(found.insert((*of, *shared))),
                None => mistakes.push(format!("{folder}: `{name}` is several types, in {files:?}")),
            }
        }
    }
    let gone = SHARED_NAMES.iter().filter(|(folder, name, _)| !found.contains(&(*folder, *name)));
    let gone = gone.map(|(folder, name, _)| format!("{folder}: `{name}` is one type by now; drop it"));
    mistakes.extend(gone);
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

#[test]
fn files_of_a_node_are_opened_in_one_place() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    find_files(root, ".rs", &mut files);
    let mistakes: Vec<String> = files.iter().flat_map(|file| node_files::mistakes(root, file)).collect();
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

#[test]
fn lines_fit_and_words_are_the_fields() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    find_files(root, ".rs", &mut files);
    let mistakes: Vec<String> = files.iter().flat_map(|file| words::mistakes(root, file)).collect();
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}
