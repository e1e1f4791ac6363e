//! Files of a node's directory are opened, made and removed by `mailbox/src/memory/files.rs` alone. It asks what a file
//! is and to which user it belongs, and follows no link.

use std::path::Path;

/// Ways to a file that `files.rs` does not see.
const DIRECT: &[&str] = &["fs::", "OpenOptions", "File::open(", "File::create", "File::options(", "openat(", "mkfifo("];

/// Sources of the mailboxes that name files themselves, and why.
const OTHERS: &[(&str, &str)] = &[
    ("mailbox/src/memory/files.rs", "the place"),
    ("mailbox/src/wake/doorbell.rs", "opens pipes, on the stack, relative to the directory"),
    ("mailbox/src/sys.rs", "files of the system, not of a node"),
    ("mailbox/src/sys/family.rs", "the same"),
    ("mailbox/src/node/process.rs", "the same: what the kernel says of a process"),
];

/// The path of a file in a node's directory, as other crates would build it.
const PATHS: &[&str] = &["node.path().join(", "node().path().join(", "join(CONFIG_FILE"];

/// What is wrong in a file: file, line, and what would be right. Tests may put into a directory whatever they want.
pub(crate) fn mistakes(root: &Path, file: &Path) -> Vec<String> {
    let name = file.strip_prefix(root).unwrap().to_str().unwrap();
    let is_test = name.starts_with("tests/") || name.contains("/tests/") || name.ends_with("tests.rs");
    if is_test || OTHERS.iter().any(|(other, _)| *other == name) {
        return Vec::new();
    }
    let text = std::fs::read_to_string(file).unwrap();
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
    let (found, instead) = if name.starts_with("mailbox/src/") {
        (DIRECT, "a method of `Directory` (`mailbox/src/memory/files.rs`)")
    } else {
        (PATHS, "`Node::put_file` or `Node::read_file`")
    };
    let lines = code.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//"));
    let wrong = lines.filter_map(|(at, line)| Some((at, found.iter().find(|way| has(line, way))?)));
    wrong.map(|(at, way)| format!("{name}:{}: `{way}`: use {instead}", at + 1)).collect()
}

/// Whether a line goes this way. An import alone does not.
fn has(line: &str, way: &str) -> bool {
    line.contains(way) && !line.trim_start().starts_with("use ")
}

#[test]
fn direct_ways_are_found_and_those_of_tests_are_not() {
    let root = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| {
        let file = root.path().join(name);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, text).unwrap();
        let found = mistakes(root.path(), &file);
        found.iter().map(|found| found.split(": use").next().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let direct =
        "use std::fs::File;\n// fs::read\nlet a = fs::read(x);\n#[cfg(test)]\nmod tests {\n    fs::read(x);\n}\n";
    let none: Vec<String> = Vec::new();
    assert_eq!(put("mailbox/src/a.rs", direct), ["mailbox/src/a.rs:3: `fs::`"]);
    assert_eq!(put("mailbox/src/memory/files.rs", direct), none);
    assert_eq!(put("cli/src/a.rs", direct), none, "files of other folders");
    let path = "let a = fs::read(self.node.path().join(FILE));";
    assert_eq!(put("cli/src/b.rs", path), ["cli/src/b.rs:1: `node.path().join(`"]);
    assert_eq!(put("cli/tests/b.rs", path), none);
}
