//! `cargo xtask instructions`: instructions of the hot paths, counted by callgrind, against recorded ceilings.
//!
//! Counts need no quiet machine: the same compiler makes the same instructions. So a commit that makes a path slower
//! fails without a clock. What they do not see: cache lines that move between processors, and the kernel.

use crate::cargo::{self, cargo, host};
use crate::failure::Failure;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// The folder of the programs that are counted, from the root.
const FOLDER: &str = "benches/instructions";
/// They count what happens inside a function of this name.
const FUNCTION: &str = "--toggle-collect=*counted*";
/// Operations that are counted, of each path.
const OPERATIONS: u64 = 5_000;
/// A ceiling is this much above what was counted, percent.
const ROOM_PERCENT: u64 = 3;
/// A path that needs so much less than its ceiling has become faster: the ceiling is to be lowered, percent.
const SLACK_PERCENT: u64 = 7;
/// A path that is slower than one with a ceiling, by that one's name; it must be above that ceiling.
const PLANTED: (&str, &str) = ("send-slower-by-a-third", "send");

/// Counts and compares; with `--record`, writes the ceilings anew.
pub(crate) fn command(args: &[String]) -> Result<ExitCode, Failure> {
    match args {
        [] => check()?,
        [record] if record == "--record" => {
            let (compiler, counts) = (compiler()?, count_all(&build()?)?);
            let path = ceilings_path();
            fs::write(&path, Ceilings::of(&compiler, &counts).to_text())
                .map_err(|error| format!("{}: {error}", path.display()))?;
        }
        others => return Err(format!("`{}`: cargo xtask instructions takes --record or nothing", others.join(" "))),
    }
    Ok(ExitCode::SUCCESS)
}

/// The stage of `cargo xtask test --all`.
pub(crate) fn check() -> Result<(), Failure> {
    let (path, compiler) = (ceilings_path(), compiler()?);
    let text = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let ceilings = Ceilings::from_text(&text)?;
    ceilings.are_of(&compiler)?;
    compare(&ceilings, &count_all(&build()?)?)
}

/// A path and the instructions of one operation.
type Count = (String, u64);

/// The recorded file.
#[derive(Debug, PartialEq, Eq)]
struct Ceilings {
    compiler: String,
    paths: Vec<Count>,
}

impl Ceilings {
    fn of(compiler: &str, counts: &[Count]) -> Self {
        let planted = |count: &&Count| count.0 != PLANTED.0;
        let ceiling = |(path, count): &Count| (path.clone(), count + (count * ROOM_PERCENT).div_ceil(100));
        Self { compiler: compiler.into(), paths: counts.iter().filter(planted).map(ceiling).collect() }
    }

    fn to_text(&self) -> String {
        let head = format!(
            "# Most instructions of one operation of each hot path, {ROOM_PERCENT} % above what was counted.\n\
             # Written by `cargo xtask instructions --record`.\n\
             compiler {}\n",
            self.compiler
        );
        self.paths.iter().fold(head, |text, (path, ceiling)| text + &format!("{path} {ceiling}\n"))
    }

    fn from_text(text: &str) -> Result<Self, Failure> {
        let mut ceilings = Self { compiler: String::new(), paths: Vec::new() };
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let bad = || format!("{FOLDER}/ceilings.txt: `{line}` is no ceiling");
            match line.split_once(' ').ok_or_else(bad)? {
                ("compiler", compiler) => ceilings.compiler = compiler.into(),
                (path, ceiling) => ceilings.paths.push((path.into(), ceiling.parse().map_err(|_| bad())?)),
            }
        }
        Ok(ceilings)
    }

    /// Counts of another compiler say nothing of the paths.
    fn are_of(&self, compiler: &str) -> Result<(), Failure> {
        if self.compiler == compiler {
            return Ok(());
        }
        Err(format!(
            "the ceilings in {FOLDER}/ceilings.txt are of the compiler {}, and this one is {compiler}: count with that \
             one, or record the ceilings of this one by `cargo xtask instructions --record`",
            self.compiler
        ))
    }
}

/// Fails with a line for each path that is above its ceiling, far below it, or without one.
fn compare(ceilings: &Ceilings, counts: &[Count]) -> Result<(), Failure> {
    let mut wrong = Vec::new();
    let ceiling_of = |path: &str| ceilings.paths.iter().find(|(name, _)| name == path).map(|(_, ceiling)| *ceiling);
    for (path, count) in counts.iter().filter(|(path, _)| path != PLANTED.0) {
        match ceiling_of(path) {
            None => wrong.push(format!("{path}: {count} instructions, and no ceiling; record it")),
            Some(ceiling) if *count > ceiling => wrong.push(format!(
                "{path}: {count} instructions, its ceiling is {ceiling}; make it faster, or record anew and say in \
                 the commit what the instructions are for"
            )),
            Some(ceiling) if count * 100 < ceiling * (100 - SLACK_PERCENT) => wrong.push(format!(
                "{path}: {count} instructions, its ceiling is {ceiling}; it has become faster, lower the ceiling"
            )),
            Some(_) => {}
        }
    }
    let counted = |path: &str| counts.iter().find(|(name, _)| name == path).map(|(_, count)| *count);
    for (path, _) in ceilings.paths.iter().filter(|(path, _)| counted(path).is_none()) {
        wrong.push(format!("{path}: has a ceiling, and is not counted; remove it"));
    }
    if counted(PLANTED.0) <= ceiling_of(PLANTED.1) {
        wrong.push(format!("{}: is not above the ceiling of {}; the count sees nothing", PLANTED.0, PLANTED.1));
    }
    if wrong.is_empty() {
        return Ok(());
    }
    wrong.push(format!("record: `cargo xtask instructions --record`, which writes {FOLDER}/ceilings.txt"));
    Err(format!("instructions of the hot paths:\n    {}", wrong.join("\n    ")))
}

fn ceilings_path() -> PathBuf {
    cargo::root().join(FOLDER).join("ceilings.txt")
}

/// Version and target: instructions of another compiler are others.
fn compiler() -> Result<String, Failure> {
    let output = Command::new("rustc").arg("--version").output().map_err(|error| format!("rustc: {error}"))?;
    let version = String::from_utf8_lossy(&output.stdout);
    Ok(format!("{} {}", version.split_whitespace().nth(1).unwrap_or("?"), host()?))
}

/// The programs, built.
fn build() -> Result<Vec<PathBuf>, Failure> {
    let valgrind = Command::new("valgrind").arg("--version").output();
    if !valgrind.is_ok_and(|output| output.status.success()) {
        return Err("no valgrind, which counts instructions; install it: `apt-get install valgrind`".into());
    }
    let mut build = cargo(&["build", "--release", "--package", "rohrpost-bench-local"]);
    build.args(["--bench", "instructions", "--bench", "instructions-c"]);
    cargo::run("building the hot paths", &mut build)?;
    // Cargo says which files it made; the names have hashes.
    let output = build.arg("--message-format=json").output().map_err(|error| format!("cargo: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let made = text.split("\"executable\":\"").skip(1).filter_map(|rest| rest.split('"').next());
    let mut made: Vec<PathBuf> = made.map(PathBuf::from).collect();
    // In one order, whichever was ready first: the recorded file has it.
    made.sort();
    Ok(made)
}

fn count_all(programs: &[PathBuf]) -> Result<Vec<Count>, Failure> {
    let mut counts = Vec::new();
    for program in programs {
        let list = Command::new(program).output().map_err(|error| format!("{}: {error}", program.display()))?;
        for path in String::from_utf8_lossy(&list.stdout).lines() {
            counts.push((path.to_owned(), count(program, path)?));
        }
    }
    eprintln!("==> instructions of one operation");
    counts.iter().for_each(|(path, count)| eprintln!("    {path:<24} {count:>6}"));
    Ok(counts)
}

/// Instructions of one operation.
fn count(program: &Path, path: &str) -> Result<u64, Failure> {
    let mut valgrind = Command::new("valgrind");
    valgrind
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", FUNCTION])
        .arg(program)
        .args([path, &OPERATIONS.to_string()]);
    let output = valgrind.output().map_err(|error| format!("valgrind: {error}"))?;
    let told = String::from_utf8_lossy(&output.stderr);
    match collected(&told).filter(|collected| output.status.success() && *collected > 0) {
        Some(collected) => Ok(collected / OPERATIONS),
        None => Err(format!("counting the instructions of {path}:\n{told}")),
    }
}

/// What callgrind counted in all.
fn collected(told: &str) -> Option<u64> {
    told.split("Collected : ").nth(1)?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPILER: &str = "1.95.0 x86_64-unknown-linux-gnu";

    fn counts(send: u64) -> Vec<Count> {
        [("send", send), ("receive", 600), (PLANTED.0, 1067)].map(|(path, count)| (path.into(), count)).into()
    }

    fn compared(counts: &[Count]) -> Result<(), Failure> {
        compare(&Ceilings::of(COMPILER, &self::counts(800)), counts)
    }

    #[test]
    fn what_is_recorded_is_read_again_and_holds() {
        let ceilings = Ceilings::of(COMPILER, &counts(800));
        assert_eq!(ceilings.paths, [("send".into(), 824), ("receive".into(), 618)]);
        assert_eq!(Ceilings::from_text(&ceilings.to_text()), Ok(ceilings));
        assert!(Ceilings::from_text("send many").unwrap_err().contains("`send many` is no ceiling"));
        assert_eq!(compared(&counts(800)), Ok(()));
        assert_eq!(compared(&counts(824)), Ok(()));
    }

    #[test]
    fn a_path_above_its_ceiling_or_far_below_it_fails() {
        let slower = compared(&counts(825)).unwrap_err();
        assert!(slower.contains("send: 825 instructions, its ceiling is 824; make it faster"), "{slower}");
        assert!(!slower.contains("receive"), "{slower}");
        let faster = compared(&counts(760)).unwrap_err();
        assert!(faster.contains("lower the ceiling"), "{faster}");
    }

    #[test]
    fn ceilings_of_another_compiler_are_named_with_both_and_with_what_to_do() {
        let ceilings = Ceilings::of(COMPILER, &counts(800));
        assert_eq!(ceilings.are_of(COMPILER), Ok(()));
        let other = ceilings.are_of("1.96.0 x86_64-unknown-linux-gnu").unwrap_err();
        for words in [COMPILER, "1.96.0 x86_64-unknown-linux-gnu", "--record"] {
            assert!(other.contains(words), "{other}");
        }
        assert!(!other.contains('\n') && !other.contains("send"), "{other}");
    }

    #[test]
    fn a_path_without_a_ceiling_and_a_ceiling_without_a_path_fail() {
        let mut more = counts(800);
        more.push(("seal".into(), 5));
        assert!(compared(&more).unwrap_err().contains("seal: 5 instructions, and no ceiling"));
        assert!(compared(&[]).unwrap_err().contains("receive: has a ceiling, and is not counted"));
    }

    #[test]
    fn a_count_that_does_not_see_the_planted_path_fails() {
        let mut blind = counts(800);
        blind.last_mut().unwrap().1 = 824;
        assert!(compared(&blind).unwrap_err().contains("the count sees nothing"));
    }

    #[test]
    fn the_sum_is_found_in_what_callgrind_tells() {
        assert_eq!(collected("==7== Events    : Ir\n==7== Collected : 4030000\n==7==\n"), Some(4_030_000));
        assert_eq!(collected("==7== Events    : Ir\n"), None);
    }
}
