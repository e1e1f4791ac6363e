//! The tutorial, to the letter: its files are written and its commands run, in their order, in a folder of their own;
//! each prints what the page shows.

use crate::docs_printed::fits;
use crate::harness::{PATIENCE, Place, ROHRPOST, repository, until};
use crate::process::Running;
use nix::sys::signal::Signal;
use std::collections::BTreeMap;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What Cargo of the new project does as that of this workspace, so that nothing is compiled twice.
const CARGO: &str = "[net]\noffline = true\n[profile.dev]\ndebug = \"line-tables-only\"\n\
                     [profile.dev.package.\"*\"]\ndebug = false\n";

/// A block of code of the page: what stands behind its fence, and its text.
struct Block {
    fence: String,
    text: String,
}

fn blocks(page: &str) -> Vec<Block> {
    let parts = page.split("\n```").skip(1).step_by(2);
    let block = |part: &str| {
        let (fence, text) = part.split_once('\n').unwrap();
        Block { fence: fence.into(), text: text.into() }
    };
    parts.map(block).collect()
}

/// Commands of a block, each with the lines that are shown below it. `^C` is one, too.
fn commands(text: &str) -> Vec<(&str, Vec<String>)> {
    let mut all: Vec<(&str, Vec<String>)> = Vec::new();
    for line in text.lines() {
        match line.strip_prefix("$ ") {
            Some(command) => all.push((command, Vec::new())),
            None if line == "^C" => all.push((line, Vec::new())),
            None => all.last_mut().unwrap().1.extend(lines([line])),
        }
    }
    all
}

/// Lines of a page or a program, as words: how wide a column is depends on what stands in it.
fn lines<'a>(text: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    text.into_iter().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// What a program has printed.
fn printed(text: &str) -> Vec<String> {
    lines(text.trim_end().lines())
}

/// A reader of the page: folder, terminals and files.
struct Reader {
    /// Programs that go on, by terminal.
    terminals: BTreeMap<String, Running>,
    folder: PathBuf,
    place: Place,
}

impl Reader {
    fn new() -> Self {
        let place = Place::new();
        std::fs::create_dir(place.path(".cargo")).unwrap();
        place.write(".cargo/config.toml", CARGO);
        Self { terminals: BTreeMap::new(), folder: place.path(""), place }
    }

    /// A line of a shell, in the present folder.
    fn shell(&self, line: &str) -> Command {
        let mut command = Command::new("bash");
        let programs = Path::new(ROHRPOST).parent().unwrap().to_str().unwrap();
        let path = std::env::var("PATH").unwrap();
        command.args(["-c", &format!("exec 2>&1; {line}")]).current_dir(&self.folder);
        command.env("PATH", format!("{programs}:{path}")).env("ROHRPOST_DIR", self.place.memory());
        // As strangers have it; the checks of this workspace compile with clippy.
        command.env_remove("RUSTC_WORKSPACE_WRAPPER").env_remove("CARGO_TARGET_DIR");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn enter(&mut self, folder: &str) {
        self.folder = self.folder.join(folder).canonicalize().unwrap();
        let target = self.folder.join("target");
        if self.folder.join("Cargo.toml").exists() && !target.exists() {
            // What this workspace has built, and the versions that are here: target/debug/deps/e2e-…
            symlink(std::env::current_exe().unwrap().ancestors().nth(3).unwrap(), target).unwrap();
            std::fs::copy(repository("Cargo.lock"), self.folder.join("Cargo.lock")).unwrap();
        }
    }

    /// A program that goes on in a terminal, until it has printed this.
    fn begin(&mut self, terminal: &str, command: &str, shown: &[String]) {
        let mut running = Running::start(self.shell(&format!("exec {command}")));
        let more = [shown, &["…".into()]].concat();
        until(format!("`{command}` prints\n{}", shown.join("\n")), || {
            running.assert_runs();
            fits(&more, &printed(&running.out()))
        });
        let before = self.terminals.insert(terminal.into(), running);
        assert!(before.is_none(), "the page ends the program in {terminal} before `{command}`");
    }

    /// Ctrl-C in a terminal.
    fn interrupt(&mut self, terminal: &str, shown: &[String]) {
        let mut running = self.terminals.remove(terminal).unwrap_or_else(|| panic!("nothing runs in {terminal}"));
        running.signal(Signal::SIGINT);
        running.end();
        let wanted = [&["…".into()], shown].concat();
        assert!(
            fits(&wanted, &printed(&running.out())),
            "{terminal} shows\n{}\nprinted\n{}",
            shown.join("\n"),
            running.out()
        );
    }

    /// A command that ends. One that only looks is asked again: what it tells may come a moment later.
    fn command(&mut self, command: &str, shown: &[String]) {
        if let Some(folder) = command.strip_prefix("cd ") {
            return self.enter(folder);
        }
        let looks = ["list", "call", "echo", "log", "param get", "record info", "net"];
        let looks = looks.iter().any(|words| command.starts_with(&format!("rohrpost {words}")));
        let begun = Instant::now();
        let said = loop {
            let said = self.shell(command).output().unwrap();
            let said = String::from_utf8(said.stdout).unwrap();
            if fits(shown, &printed(&said)) || !looks || begun.elapsed() > PATIENCE {
                break said;
            }
            std::thread::sleep(Duration::from_millis(100));
        };
        let is_so = fits(shown, &printed(&said));
        assert!(is_so, "`{command}` is shown with\n{}\n\nand prints\n{said}", shown.join("\n"));
    }

    fn follow(&mut self, block: &Block) {
        match block.fence.split_once(' ') {
            None if block.fence == "text" => {
                commands(&block.text).iter().for_each(|(command, shown)| self.command(command, shown));
            }
            Some(("text", terminal)) => {
                for (command, shown) in commands(&block.text) {
                    match command {
                        "^C" => self.interrupt(terminal, &shown),
                        _ => self.begin(terminal, command, &shown),
                    }
                }
            }
            Some((_, file)) => std::fs::write(self.folder.join(file), format!("{}\n", block.text)).unwrap(),
            None => panic!("a block of {} names no file", block.fence),
        }
    }
}

#[test]
fn each_step_of_the_tutorial_does_what_it_shows() {
    let page = std::fs::read_to_string(repository("docs/src/tutorial.md")).unwrap();
    let mut reader = Reader::new();
    blocks(&page).iter().for_each(|block| reader.follow(block));
    assert!(reader.terminals.is_empty(), "at the end something still runs");
    // Build products of a removed project are useless.
    reader.command("cargo clean --package weather", &["…".into()]);
}
