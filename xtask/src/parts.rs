//! How long each test program of a `cargo test` takes, from what Cargo says on the way, and what it costs: processor
//! time of user and kernel, also on a machine that does other things.
//!
//! The kernel adds a process's time to that of its parent when the parent waits for it. So what a stage has left
//! running, and what ended without a parent that waits, is not counted.

use crate::cargo;
use crate::failure::Failure;
use std::io::{self, BufRead, BufReader, PipeReader, Write};
use std::iter::Sum;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// A part of a stage takes this long to have a row of its own.
const OWN_ROW: Duration = Duration::from_secs(5);
/// While nothing is printed, the command is looked at so often.
const LOOK: Duration = Duration::from_millis(100);
/// What comes for so long after the command's end is still shown.
const LAST_WORDS: Duration = Duration::from_secs(3);

/// A part of a stage: what Cargo builds, a test program, or a crate's doc tests.
pub(crate) struct Part {
    pub(crate) name: String,
    pub(crate) took: Spent,
}

/// What something has cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Spent {
    pub(crate) wall: Duration,
    pub(crate) processor: Duration,
}

impl Sum for Spent {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, next| Self {
            wall: sum.wall + next.wall,
            processor: sum.processor + next.processor,
        })
    }
}

/// Runs `cargo test`, shows what it prints, and takes the time of its parts.
pub(crate) fn run(why: &str, mut command: Command) -> (Vec<Part>, Result<(), Failure>) {
    let shown = cargo::shown(&command);
    eprintln!("==> {why}\n    {shown}");
    let (mut clock, before) = (PartClock::new(Instant::now()), of_ended_children());
    let seen = |line: &str, pid| clock.line(line, Instant::now(), processor_of(pid));
    let result = match follow(&mut command, seen) {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{why}: `{shown}` ended with {status}")),
        Err(error) => Err(format!("cannot run `{shown}`: {error}")),
    };
    (clock.end(Instant::now(), of_ended_children() - before), result)
}

/// Both outputs are one, so that what Cargo says of a program comes before what that prints.
///
/// A process that a killed test leaves behind holds the pipe for as long as it lives: only the command is waited for.
fn follow(command: &mut Command, mut see: impl FnMut(&str, u32)) -> io::Result<ExitStatus> {
    let (reader, writer) = io::pipe()?;
    let mut child = command.stdout(writer.try_clone()?).stderr(writer).spawn()?;
    // The command holds the writing ends; the pipe ends with the last of them.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let (lines, mut out, mut ended) = (lines_of(reader), io::stdout(), None);
    loop {
        let next = lines.recv_timeout(LOOK);
        if ended.is_none() {
            ended = child.try_wait()?.map(|status| (status, Instant::now() + LAST_WORDS));
        }
        let came = match &next {
            Ok((came, _)) => *came,
            Err(RecvTimeoutError::Timeout) => Instant::now(),
            Err(RecvTimeoutError::Disconnected) => return child.wait(),
        };
        if let Some((status, _)) = ended.filter(|(_, until)| came > *until) {
            eprintln!("xtask: a process that `{}` has left behind still holds its output", cargo::shown(command));
            return Ok(status);
        }
        if let Ok((_, line)) = next {
            let line = line?;
            see(&String::from_utf8_lossy(&line), child.id());
            out.write_all(&line)?;
        }
    }
}

/// Lines, each with the moment when it was read; they end with the pipe, or with an error.
fn lines_of(reader: PipeReader) -> Receiver<(Instant, io::Result<Vec<u8>>)> {
    let (lines, received) = channel();
    std::thread::spawn(move || {
        let mut reader = BufReader::new(reader);
        loop {
            let mut line = Vec::new();
            let read = reader.read_until(b'\n', &mut line);
            let is_last = !matches!(read, Ok(1..));
            if matches!(read, Ok(0)) || lines.send((Instant::now(), read.map(|_| line))).is_err() || is_last {
                return;
            }
        }
    });
    received
}

/// Ends a part where the next begins.
struct PartClock {
    parts: Vec<Part>,
    name: String,
    began: Instant,
    /// Processor time of all before this part.
    before: Duration,
}

impl PartClock {
    fn new(began: Instant) -> Self {
        Self { parts: Vec::new(), name: "build".to_owned(), began, before: Duration::ZERO }
    }

    /// `processor`: what the command and its ended children have used, if that is known.
    fn line(&mut self, line: &str, now: Instant, processor: Option<Duration>) {
        let Some(next) = program(line) else { return };
        let name = std::mem::replace(&mut self.name, next);
        self.part(name, now, processor.unwrap_or(self.before));
    }

    fn part(&mut self, name: String, now: Instant, processor: Duration) {
        let took = Spent { wall: now - self.began, processor: processor.saturating_sub(self.before) };
        self.parts.push(Part { name, took });
        (self.began, self.before) = (now, processor);
    }

    /// The longest first; short ones in one row.
    fn end(mut self, now: Instant, processor: Duration) -> Vec<Part> {
        let name = std::mem::take(&mut self.name);
        self.part(name, now, processor);
        let is_long = |part: &Part| part.took.wall.max(part.took.processor) >= OWN_ROW;
        let (mut long, short): (Vec<_>, Vec<_>) = self.parts.into_iter().partition(is_long);
        long.sort_by_key(|part| std::cmp::Reverse(part.took.wall));
        if !short.is_empty() {
            let name = format!("{} more, each below {} s", short.len(), OWN_ROW.as_secs());
            long.push(Part { name, took: short.iter().map(|part| part.took).sum() });
        }
        long
    }
}

/// What a line begins: `Running tests/tidy.rs (target/debug/deps/tidy-0123456789abcdef)`, `Doc-tests rohrpost`.
fn program(line: &str) -> Option<String> {
    let line = line.trim();
    if let Some(of) = line.strip_prefix("Doc-tests ") {
        return Some(format!("examples in the docs of {of}"));
    }
    let (_, path) = line.strip_prefix("Running ")?.split_once('(')?;
    let (_, file) = path.strip_suffix(')')?.rsplit_once("deps/")?;
    Some(file.rsplit_once('-')?.0.to_owned())
}

/// The unit of `/proc/PID/stat` is 1/100 s on every machine (`USER_HZ`, see proc(5) and time(7)).
const TICK: Duration = Duration::from_millis(10);

/// Of all children of this process that it has waited for, and theirs.
pub(crate) fn of_ended_children() -> Duration {
    times("self").map_or(Duration::ZERO, |[_, _, user, kernel]| user + kernel)
}

/// Of a process, and of its children that it has waited for; none if it is gone.
pub(crate) fn processor_of(pid: u32) -> Option<Duration> {
    times(&pid.to_string()).map(|times| times.iter().sum())
}

/// User's and kernel's time of a process, then of its ended children.
fn times(pid: &str) -> Option<[Duration; 4]> {
    read(&std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
}

fn read(stat: &str) -> Option<[Duration; 4]> {
    // The second field is the program's name in brackets, and may hold spaces and brackets; the four are the 14th to
    // 17th.
    let (_, rest) = stat.rsplit_once(')')?;
    let mut fields = rest.split_whitespace().skip(11).map(|field| field.parse::<u32>().ok().map(|ticks| TICK * ticks));
    Some([fields.next()??, fields.next()??, fields.next()??, fields.next()??])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;
    use std::process::Command;

    #[test]
    fn a_part_lasts_from_its_line_to_the_next() {
        let began = Instant::now();
        let mut clock = PartClock::new(began);
        let lines = [
            (1, "   Compiling rohrpost v0.1.0"),
            (60, "     Running tests/e2e/main.rs (target/debug/deps/e2e-0123456789abcdef)"),
            (330, "     Running unittests src/lib.rs (target/debug/deps/rohrpost_mailbox-0123456789abcdef)"),
            (331, "test Running late (deps/a-b) ... ok"),
            (332, "   Doc-tests rohrpost"),
        ];
        // The command has used half of the time so far; at its end it was seen to have used a little more.
        let seconds = Duration::from_secs;
        lines.iter().for_each(|(at, line)| clock.line(line, began + seconds(*at), Some(seconds(at / 2))));
        let parts = clock.end(began + seconds(335), seconds(170));
        let seen: Vec<_> = parts
            .iter()
            .map(|Part { name, took }| (name.as_str(), took.wall.as_secs(), took.processor.as_secs()))
            .collect();
        assert_eq!(seen, [("e2e", 270, 135), ("build", 60, 30), ("2 more, each below 5 s", 5, 5)]);
    }

    #[test]
    fn what_a_program_prints_is_followed_to_its_end() {
        let mut lines = Vec::new();
        let mut command = Command::new("sh");
        command.args(["-c", "echo one; echo two >&2; printf three; exit 3"]);
        let status = follow(&mut command, |line, _| lines.push(line.trim().to_owned())).expect("sh runs");
        assert_eq!((lines.join(" "), status.code()), ("one two three".to_owned(), Some(3)));
    }

    /// As a test that is killed leaves a process behind.
    #[test]
    fn a_process_that_is_left_behind_with_the_output_is_not_waited_for() {
        let mut lines = Vec::new();
        let mut command = Command::new("sh");
        command.args(["-c", "sleep 60 & echo $!; kill -9 $$"]);
        let status = follow(&mut command, |line, _| lines.push(line.trim().to_owned())).expect("sh runs");
        assert_eq!((lines.len(), status.signal()), (1, Some(9)), "{lines:?}");
        let killed = Command::new("kill").arg(&lines[0]).status().expect("kill runs");
        assert!(killed.success(), "it was waited for");
    }

    #[test]
    fn a_name_with_brackets_shifts_no_field() {
        let stat = "7 (a) b (c) S 1 7 7 0 -1 4194560 1 2 3 4 150 25 300 75 20 0 1 0 100\n";
        assert_eq!(read(stat), Some([1500, 250, 3000, 750].map(Duration::from_millis)));
        assert_eq!(read("7 (a) S 1"), None);
    }

    #[test]
    fn what_a_child_has_used_is_seen_once_it_has_ended() {
        let before = of_ended_children();
        // Some 100 ms of a shell; ten is asked for, the unit.
        let busy = "i=0; while [ $i -lt 100000 ]; do i=$((i + 1)); done";
        assert!(Command::new("sh").args(["-c", busy]).status().unwrap().success());
        assert!(of_ended_children() - before >= TICK);
        assert!(processor_of(std::process::id()) >= Some(of_ended_children()) && processor_of(u32::MAX).is_none());
    }
}
