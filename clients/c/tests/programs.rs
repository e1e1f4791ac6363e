//! The programs in C beside this, compiled as their users do, and run: plain, under AddressSanitizer, and by valgrind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost::interface::Interface;
use rohrpost::interfaces::{CameraInterface, LaserInterface, WheelsInterface};
use rohrpost::types::Image;
use rohrpost_test_report::skipped;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A way to compile: a compiler, and what it is told.
const WAYS: [(&str, &[&str]); 6] = [
    ("gcc", &["-std=c11"]),
    ("gcc", &["-std=c11", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]),
    ("g++", &["-std=c++17", "-x", "c++"]),
    ("g++", &["-std=c++17", "-x", "c++", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]),
    ("clang", &["-std=c11"]),
    ("clang++", &["-std=c++17", "-x", "c++"]),
];

fn is_there(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Compiles a program of this folder with warnings as errors, linked with the shared library of this build.
fn compiled(folder: &Path, way: (&str, &[&str]), source: &str) -> PathBuf {
    // Not by the new tags, before which LD_LIBRARY_PATH counts: Cargo's leads to the library of an earlier build.
    let rpath = format!("-Wl,--disable-new-dtags,-rpath,{}", libraries().display());
    linked(folder, way, source, &[&rpath, "-lrohrpost_c", "-lm"])
}

/// target/debug/deps, where Cargo has put them.
fn libraries() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_owned()
}

fn linked(folder: &Path, (compiler, options): (&str, &[&str]), source: &str, libraries: &[&str]) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = folder.join("program");
    let output = Command::new(compiler)
        .args(["-Wall", "-Wextra", "-Wshadow", "-Werror", "-pthread", "-D_GNU_SOURCE"])
        .args(options)
        .arg(here.join("tests").join(source))
        .arg("-I")
        .arg(here.join("include"))
        .arg("-o")
        .arg(&program)
        .arg("-L")
        .arg(self::libraries())
        .args(["-x", "none"])
        .args(libraries)
        .output()
        .unwrap();
    assert!(output.status.success(), "{compiler} {options:?}: {}", String::from_utf8_lossy(&output.stderr));
    program
}

/// Runs it with a directory for a node of its own; what it prints before it says that all is well.
fn runs(mut command: Command, folder: &Path) -> String {
    command.arg(folder.join("node")).env_remove("ROHRPOST_CONFIG");
    let output = command.output().unwrap();
    let [printed, said] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let printed = printed.strip_suffix("all is well\n").filter(|_| output.status.success());
    printed.unwrap_or_else(|| panic!("{command:?}: {}\n{said}", output.status)).to_owned()
}

fn every_way(source: &str, prints: &str) {
    let is_for = |compiler: &str| !source.ends_with(".cpp") || compiler.ends_with("++");
    for way in WAYS.into_iter().filter(|way| is_for(way.0)) {
        if !is_there(way.0) {
            skipped(&format!("C by {}, which is not there", way.0));
            continue;
        }
        // In shared memory, as a node is.
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let program = compiled(folder.path(), way, source);
        assert_eq!(runs(Command::new(&program), folder.path()), prints, "{way:?}");
    }
}

/// Every byte that is read was written, and every one is given back.
fn by_valgrind(source: &str) {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    if let Some(command) = valgrind(folder.path(), source) {
        runs(command, folder.path());
    }
}

/// A program under valgrind, if that is there.
fn valgrind(folder: &Path, source: &str) -> Option<Command> {
    if !is_there("valgrind") {
        skipped("C by valgrind, which is not there");
        return None;
    }
    let program = compiled(folder, ("gcc", &["-std=c11", "-g"]), source);
    let mut command = Command::new("valgrind");
    command.args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"]);
    command.arg(format!("--suppressions={}/tests/valgrind.supp", env!("CARGO_MANIFEST_DIR"))).arg(program);
    Some(command)
}

#[test]
fn mailboxes_and_streams_in_c_and_in_c_plus_plus() {
    every_way("mailboxes.c", "");
}

#[test]
fn values_in_c_and_in_c_plus_plus() {
    every_way("values.c", "");
}

#[test]
fn the_static_library_needs_what_its_pkg_config_file_says() {
    let description = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("rohrpost.pc.in")).unwrap();
    let private = description.lines().find_map(|line| line.strip_prefix("Libs.private: ")).unwrap();
    let libraries: Vec<&str> = ["-l:librohrpost_c.a"].into_iter().chain(private.split(' ')).collect();
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let program = linked(folder.path(), ("gcc", &["-std=c11"]), "values.c", &libraries);
    assert_eq!(runs(Command::new(program), folder.path()), "");
}

#[test]
fn packages_and_records_take_nothing_from_the_heap() {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let program = compiled(folder.path(), ("gcc", &["-std=c11"]), "hot_path.c");
    assert_eq!(runs(Command::new(program), folder.path()), "");
}

#[test]
fn wrappers_in_c_plus_plus() {
    every_way("wrappers.cpp", "");
}

/// As `tests/interfaces.c` has it.
#[rohrpost::data]
enum Either {
    Nothing,
    Number(i16),
    Pose {
        #[schema(unit = "m")]
        x_m: f64,
        #[schema(unit = "m")]
        y_m: f64,
        #[schema(unit = "rad")]
        heading_rad: f64,
    },
}

/// The same.
#[rohrpost::interface(class = "zoo")]
trait Zoo {
    /// Takes all.
    #[command(16)]
    fn all(
        &mut self,
        numbers: [u8; 3],
        words: Option<String>,
        letter: char,
        either: Either,
        large: u128,
        #[schema(unit = "%")] share: f32,
    ) -> (String, bool);

    /// Takes none.
    #[command(17)]
    fn nothing(&mut self);

    /// Values by words.
    #[data(1)]
    fn values() -> BTreeMap<String, f64>;

    /// A picture.
    #[stream(2)]
    fn image() -> Image;
}

#[test]
fn interfaces_in_c_have_the_hashes_of_those_in_rust() {
    let all = [
        WheelsInterface::description(),
        LaserInterface::description(),
        CameraInterface::description(),
        ZooInterface::description(),
    ];
    every_way("interfaces.c", &all.map(|description| format!("{:08x}\n", description.hash())).concat());
}

#[test]
fn interfaces_by_valgrind() {
    by_valgrind("interfaces.c");
}

#[test]
fn mailboxes_and_streams_by_valgrind() {
    by_valgrind("mailboxes.c");
}

#[test]
fn values_by_valgrind() {
    by_valgrind("values.c");
}

#[test]
fn valgrind_finds_what_c_did_not_set() {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    if let Some(mut command) = valgrind(folder.path(), "unset.c") {
        let output = command.arg(folder.path().join("node")).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        // In the library alone: the program looks at nothing that comes of it.
        assert!(output.status.code() == Some(9) && said.contains("Conditional jump"), "{said}");
    }
}
