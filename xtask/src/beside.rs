//! The GUI bridge, built beside a demo that runs already.
//!
//! ```text
//! xtask demo ──spawns──▶ xtask bridge-beside PID ──spawns, in a group of its own──▶ nice 19: cargo build
//!     │  ◀── one word ───────────┤
//!     └─becomes─▶ rohrpost demo ◀┴─ rohrpost start gui.0, when the bridge is there
//! ```
//!
//! The demo takes xtask's place, so the terminal, Ctrl-C and the exit code are its own. What builds is its child, and
//! ends the build as soon as it has another parent: the demo has ended, however that came. It prints nothing into the
//! demo's terminal. All goes to a file, the last line of which says how far it is; the demo shows that line.

use crate::cargo::{self, BRIDGE};
use crate::crates::{self, Added, Crates, JSON};
use crate::failure::Failure;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, parent_id};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// The command of xtask that builds beside a demo.
pub(crate) const COMMAND: &str = "bridge-beside";
/// The module that the bridge is, in `config/demo.toml`.
const GUI: &str = "gui.0";
/// The demo is looked for so often.
const LOOK: Duration = Duration::from_millis(250);
/// A robot that starts takes orders within so many tries, a second each.
const TRIES: u32 = 20;
/// What Cargo says first when it has something to do; when it has not, it says nothing of the kind.
const WORK: [&str; 8] =
    ["Compiling", "Dirty", "Downloading", "Downloaded", "Updating", "Locking", "Adding", "Blocking"];

/// How it stands with the bridge when the robot starts. The words are what one xtask tells the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Begun {
    /// It is there, built of the present sources.
    IsThere,
    /// It is being built, or could not be built, which the file says.
    Later,
}

/// Begins to build the bridge. Returns when it is there, or when that takes longer than a look.
pub(crate) fn begin() -> Result<Begun, Failure> {
    let log = File::create(log()).map_err(|error| format!("{}: {error}", log().display()))?;
    let myself = std::env::current_exe().map_err(|error| format!("the path of xtask: {error}"))?;
    let mut watcher = Command::new(myself);
    watcher.args([COMMAND, &std::process::id().to_string()]).process_group(0);
    watcher.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(log);
    let mut watcher = watcher.spawn().map_err(|error| format!("xtask {COMMAND}: {error}"))?;
    let mut word = String::new();
    if let Some(stdout) = watcher.stdout.take() {
        BufReader::new(stdout).read_line(&mut word).map_err(|error| format!("xtask {COMMAND}: {error}"))?;
    }
    if word.trim() == "there" {
        // It has nothing more to do; the demo is not to inherit it.
        watcher.wait().map_err(|error| format!("xtask {COMMAND}: {error}"))?;
        return Ok(Begun::IsThere);
    }
    eprintln!(
        "==> the robot starts; the GUI bridge with Rerun is built beside it, at low priority, and joins it as {GUI}\n\
         {:4}how far that is: {} (`cargo demo --no-gui` goes without)",
        "",
        shown_log().display()
    );
    Ok(Begun::Later)
}

/// The file that tells of the build.
fn log() -> PathBuf {
    cargo::target().join("gui-bridge-build.log")
}

/// The file that tells of the build, as a user would type it.
pub(crate) fn shown_log() -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    log().strip_prefix(here).map_or_else(|_| log(), Path::to_owned)
}

/// `xtask bridge-beside PID`: builds, starts the module, and ends with that process. Its standard error is the file.
pub(crate) fn run(args: &[String]) -> Result<ExitCode, Failure> {
    let demo = args.first().and_then(|pid| pid.parse().ok()).ok_or("of which process? It is called by `xtask demo`")?;
    let mut build = build_command();
    eprintln!("{}", cargo::shown(&build));
    build.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
    let mut build = build.spawn().map_err(|error| format!("the build cannot be run: {error}"))?;
    let mut progress = Progress::default();
    let status = progress.follow(&mut build, demo).map_err(|error| format!("the build cannot be watched: {error}"))?;
    match status {
        None => eprintln!("the demo has ended, and the build with it: {}", progress.crates),
        Some(status) if status.success() && !progress.has_begun => return answer("there"),
        Some(status) if status.success() => join(demo),
        Some(status) => {
            progress.begin(|| ());
            eprintln!("the build failed: `cargo build --package {BRIDGE}` ended with {status}; above is why");
        }
    }
    // A child that ends is for its parent to collect, and the demo knows nothing of this one.
    while parent_id() == demo {
        std::thread::sleep(LOOK);
    }
    Ok(ExitCode::SUCCESS)
}

/// The one word for xtask.
fn answer(word: &str) -> Result<ExitCode, Failure> {
    // If it has gone meanwhile, nobody needs the word.
    let _ = writeln!(io::stdout(), "{word}");
    Ok(ExitCode::SUCCESS)
}

/// Behind all else that wants to run: with the least niceness, and where `chrt` is installed, in the scheduling class
/// for idle processors. It says what it does, whatever the user's settings are: that is read here.
fn build_command() -> Command {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let has_chrt = std::env::split_paths(&path).any(|folder| folder.join("chrt").exists());
    let before = ["nice", "-n", "19", "chrt", "--idle", "0"];
    let before = if has_chrt { &before[..] } else { &before[..3] };
    let mut command = cargo::cargo_behind(before, &["build", "--package", BRIDGE, JSON]);
    for (name, value) in [("COLOR", "never"), ("QUIET", "false"), ("VERBOSE", "false"), ("PROGRESS_WHEN", "never")] {
        command.env(format!("CARGO_TERM_{name}"), value);
    }
    command
}

/// What comes from the build.
enum News {
    Line(String),
    Json(String),
    Needed(usize),
    /// One of the two streams has ended.
    End,
}

/// How far a build is.
#[derive(Default)]
struct Progress {
    /// It has something to do, and xtask knows.
    has_begun: bool,
    crates: Crates,
}

impl Progress {
    /// Writes down how far the build is, until it ends; none if the demo has ended before, and the build with it.
    fn follow(&mut self, build: &mut Child, demo: u32) -> io::Result<Option<ExitStatus>> {
        let (sender, news) = channel();
        pass_on(build.stderr.take(), sender.clone(), News::Line);
        pass_on(build.stdout.take(), sender.clone(), News::Json);
        match self.read(&news, &sender, || parent_id() == demo) {
            true => build.wait().map(Some),
            false => end(build).map(|()| None),
        }
    }

    /// True when both streams have ended; false when nobody waits any more.
    fn read(&mut self, news: &Receiver<News>, sender: &Sender<News>, is_waited_for: impl Fn() -> bool) -> bool {
        let count = || {
            let sender = sender.clone();
            // A thread: Cargo may wait for a lock, and the demo must be looked for.
            std::thread::spawn(move || sender.send(News::Needed(crates::needed(BRIDGE))));
        };
        let mut open = 2;
        while open > 0 {
            if !is_waited_for() {
                return false;
            }
            match news.recv_timeout(LOOK) {
                Ok(News::Line(line)) => self.note_line(&line, count),
                Ok(News::Json(line)) => self.note_crate(&line, count),
                Ok(News::Needed(all)) => self.crates.all = all,
                Ok(News::End) => open -= 1,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return true,
            }
        }
        true
    }

    fn note_line(&mut self, line: &str, count: impl FnOnce()) {
        if is_work(line) {
            self.begin(count);
        }
        // What is compiled is in the numbers.
        if !line.trim().is_empty() && !line.trim_start().starts_with("Compiling ") {
            eprintln!("{line}");
        }
    }

    fn note_crate(&mut self, line: &str, count: impl FnOnce()) {
        let added = self.crates.read(line);
        if added == Some(Added::Compiled) {
            self.begin(count);
        }
        if added.is_some() && self.has_begun {
            eprintln!("{}", self.crates);
        }
    }

    /// The robot need not wait. A bridge of earlier sources goes, so that it is not started.
    fn begin(&mut self, count: impl FnOnce()) {
        if std::mem::replace(&mut self.has_begun, true) {
            return;
        }
        let old = cargo::target().join("debug").join(BRIDGE);
        match std::fs::remove_file(&old) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => eprintln!("{}: {error}", old.display()),
            _ => {}
        }
        let _ = answer("later");
        count();
    }
}

/// Whether Cargo says that it has something to do.
fn is_work(line: &str) -> bool {
    line.split_whitespace().next().is_some_and(|first| WORK.contains(&first))
}

fn pass_on(stream: Option<impl Read + Send + 'static>, to: Sender<News>, news: fn(String) -> News) {
    std::thread::spawn(move || {
        let lines = stream.into_iter().flat_map(|stream| BufReader::new(stream).split(b'\n'));
        for line in lines.map_while(Result::ok) {
            let _ = to.send(news(String::from_utf8_lossy(&line).into_owned()));
        }
        let _ = to.send(News::End);
    });
}

/// Ends a build and all that it has started, which are one group of processes.
fn end(build: &mut Child) -> io::Result<()> {
    // The shell's `kill`: a program of that name is not everywhere.
    let group = build.id().to_string();
    Command::new("sh").args(["-c", "kill -s TERM -- -$0", &group]).status()?;
    build.wait().map(drop)
}

/// The module that was left out is started in the robot that runs.
fn join(demo: u32) {
    let mut words = String::new();
    for _ in 0..TRIES {
        match start() {
            _ if parent_id() != demo => return,
            Ok(said) => return eprintln!("{said}"),
            Err(why) => words = why,
        }
        std::thread::sleep(Duration::from_secs(1));
    }
    eprintln!("the GUI bridge is built; {GUI} did not join: {words}");
}

/// What `rohrpost start` says, its last line alone.
fn start() -> Result<String, String> {
    let mut command = Command::new(cargo::target().join("debug").join("rohrpost"));
    command.args(["start", GUI]).stdin(Stdio::null());
    // The demo has it from there, if it is there; so it is known among other robots.
    let config = Path::new("config/demo.toml");
    if config.exists() {
        command.arg("--config").arg(config);
    }
    let output = command.output().map_err(|error| error.to_string())?;
    let said = if output.status.success() { output.stdout } else { output.stderr };
    let last = String::from_utf8_lossy(&said).lines().next_back().unwrap_or("it says nothing").to_owned();
    if output.status.success() { Ok(last) } else { Err(last) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cargo_says_tells_whether_it_has_something_to_do() {
        for (line, is, why) in [
            ("   Compiling serde v1.0.2", true, "it compiles"),
            ("    Blocking waiting for file lock on build directory", true, "another build may take long"),
            ("    Updating crates.io index", true, "it fetches"),
            ("    Finished `dev` profile [unoptimized] target(s) in 0.21s", false, "all was there"),
            ("warning: unused variable: `Compiling`", false, "a warning that was kept"),
            ("", false, "nothing"),
        ] {
            assert_eq!(is_work(line), is, "{why}");
        }
    }
}
