//! Launch as systemd starts it: its notifications to the service manager, and when they stop.

use crate::harness::{Place, probe, state, until};
use crate::process::Running;
use nix::sys::ptrace;
use nix::sys::signal::Signal;
use nix::unistd::Pid;
use rohrpost_testbed::report::skipped;
use std::fs::File;
use std::io::{PipeReader, PipeWriter, Write};
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// The manager's side, as systemd has it: listens at a socket, and records messages.
struct Manager {
    socket: UnixDatagram,
    said: Vec<String>,
}

impl Manager {
    fn new(socket: UnixDatagram) -> Self {
        socket.set_nonblocking(true).unwrap();
        Self { socket, said: Vec::new() }
    }

    /// Messages since the last call.
    fn hear(&mut self) -> usize {
        let (before, mut bytes) = (self.said.len(), [0; 4096]);
        while let Ok(len) = self.socket.recv(&mut bytes) {
            self.said.extend(String::from_utf8_lossy(&bytes[..len]).lines().map(str::to_owned));
        }
        self.said.len() - before
    }

    fn has(&mut self, line: &str) -> bool {
        self.hear();
        self.said.iter().any(|said| said == line)
    }

    fn pings(&mut self) -> usize {
        self.hear();
        self.said.iter().filter(|said| *said == "WATCHDOG=1").count()
    }
}

fn launch(place: &Place, modules: &[&str], socket: &str, watchdog_ms: u64) -> Running {
    let config = place.config(modules);
    let mut command = place.command(&["launch", "--quiet", config.to_str().unwrap()]);
    command.env("NOTIFY_SOCKET", socket).env("WATCHDOG_USEC", (watchdog_ms * 1000).to_string());
    Running::start(command)
}

#[test]
fn the_manager_hears_that_it_is_ready_alive_and_stopping() {
    let place = Place::new();
    let abstract_name = format!("rohrpost-e2e-{}", std::process::id());
    let path = place.path("notify");
    let by_name = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&abstract_name).unwrap()).unwrap();
    for (socket, text) in [
        (UnixDatagram::bind(&path).unwrap(), path.to_str().unwrap().to_owned()),
        (by_name, format!("@{abstract_name}")),
    ] {
        let mut manager = Manager::new(socket);
        let slow = probe("probe.1", "slow-ms = 300", "");
        let mut launch = launch(&place, &[&probe("probe.0", "", ""), &slow], &text, 400);
        until("it is starting", || manager.has("STATUS=starting the modules of node main"));
        until("it is ready", || {
            launch.assert_runs();
            manager.has("READY=1")
        });
        let robot = place.robot(&place.path("test.toml"), "main", &mut launch);
        assert_eq!((robot.state("probe.0"), robot.state("probe.1")), ("on", "on"), "not before all are on");
        assert!(manager.has("STATUS=2 modules run"), "{:?}", manager.said);
        for count in 1..=3 {
            until(format!("ping {count}"), || manager.pings() >= count);
        }
        place.say(&["stop", "probe.1"]).ok();
        until("the manager learns that a module is stopped", || manager.has("STATUS=1 modules run, probe.1 stopped"));
        assert!(!manager.has("STOPPING=1"));
        launch.stop();
        assert!(manager.has("STOPPING=1"), "{:?}", manager.said);
        std::fs::remove_file(place.path("record")).unwrap();
    }
}

/// Stops one thread of a child process, and no other: only its tracer can.
struct Held {
    thread: Pid,
}

impl Held {
    fn hold(pid: u32) -> nix::Result<Self> {
        let thread = Pid::from_raw(pid as i32);
        ptrace::seize(thread, ptrace::Options::empty())?;
        ptrace::interrupt(thread)?;
        let held = Self { thread };
        until("the thread stands", || held.states().0 == 't');
        Ok(held)
    }

    /// States of the thread, and of the others of its process.
    fn states(&self) -> (char, Vec<char>) {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.thread)).unwrap().map(|task| task.unwrap().path());
        let (own, others): (Vec<_>, Vec<_>) = tasks.partition(|task| task.ends_with(self.thread.to_string()));
        let state = |task: &std::path::PathBuf| state(&task.join("stat"));
        (state(&own[0]), others.iter().map(state).collect())
    }

    fn let_go(self) {
        ptrace::detach(self.thread, None).unwrap();
    }
}

#[test]
fn a_launch_with_a_hung_loop_is_silent_whatever_its_other_threads_do() {
    let place = Place::new();
    let path = place.path("notify");
    let mut manager = Manager::new(UnixDatagram::bind(&path).unwrap());
    let period = Duration::from_millis(200);
    let mut launch = launch(&place, &[&probe("probe.0", "", "")], path.to_str().unwrap(), 200);
    until("it pings", || manager.pings() >= 2);
    // The loop is the main thread's. The end of its child must not be awaited while it is traced.
    let held = match Held::hold(launch.pid()) {
        Ok(held) => held,
        Err(error) => return skipped(&format!("whether a launch that hangs falls silent (ptrace: {error})")),
    };
    manager.hear();
    let deadline = Instant::now() + 5 * period;
    while Instant::now() < deadline {
        assert_eq!(manager.hear(), 0, "it does not go round, and says that it does");
        std::thread::sleep(period / 10);
    }
    let (own, others) = held.states();
    assert_eq!(own, 't');
    assert!(!others.is_empty() && others.iter().all(|state| matches!(state, 'S' | 'R')), "{others:?}");
    held.let_go();
    until("it pings again", || manager.hear() > 0);
    launch.stop();
}

/// A full pipe without a reader.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, writer) = std::io::pipe().unwrap();
    // Opened a second time, so that only this descriptor is non-blocking.
    let again = format!("/proc/self/fd/{}", writer.as_raw_fd());
    let mut again = File::options().write(true).custom_flags(nix::libc::O_NONBLOCK).open(again).unwrap();
    while again.write(&[b'\n'; 4096]).is_ok() {}
    while again.write(b"\n").is_ok() {}
    (reader, writer)
}

#[test]
fn a_launch_with_unread_output_goes_on_and_ends_in_order() {
    let place = Place::new();
    let path = place.path("notify");
    let mut manager = Manager::new(UnixDatagram::bind(&path).unwrap());
    let config = place.config(&[&probe("probe.0", "", "restart = { at-most = 100, backoff = \"10 ms\" }")]);
    let (reader, writer) = full_pipe();
    let mut command = place.command(&["launch", config.to_str().unwrap()]);
    command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "200000");
    command.stdout(writer.try_clone().unwrap()).stderr(writer);
    let (mut launch, robot) = place.up(command, &config, "main");
    for _ in 0..3 {
        robot.kill("probe.0");
        let pings = manager.pings();
        until("it pings", || manager.pings() > pings);
    }
    launch.stop();
    assert!(manager.has("STOPPING=1"), "{:?}", manager.said);
    place.assert_empty();
    drop(reader);
}

#[test]
fn a_manager_that_cannot_be_told_anything_stops_no_robot() {
    let place = Place::new();
    let long = format!("/{}", "x".repeat(200));
    let mut launch = launch(&place, &[&probe("probe.0", "", "")], &long, 200);
    let robot = place.robot(&place.path("test.toml"), "main", &mut launch);
    robot.wait_on(&mut launch);
    launch.stop();
    let warning = format!("no word to the service manager: NOTIFY_SOCKET={long}: ");
    assert!(launch.err().starts_with(&warning), "{}", launch.err());
    assert_eq!(launch.err().lines().count(), 1);
}

#[test]
fn a_manager_that_reads_nothing_keeps_no_module_unwatched() {
    let place = Place::new();
    let path = place.path("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    let mut launch =
        launch(&place, &[&probe("probe.0", "", "restart = { backoff = \"50 ms\" }")], path.to_str().unwrap(), 2);
    let robot = place.robot(&place.path("test.toml"), "main", &mut launch);
    robot.wait_on(&mut launch);
    // By now its queue is full.
    let full = UnixDatagram::unbound().unwrap();
    full.set_nonblocking(true).unwrap();
    until("the queue is full", || full.send_to(b"x", &path).is_err());
    robot.kill("probe.0");
    launch.stop();
    drop(socket);
}

#[test]
fn what_it_says_to_the_journal_begins_with_its_urgency() {
    let place = Place::new();
    let journal = place.path("journal");
    let launch = |settings: &str| {
        let config = place.config(&[&probe("probe.0", settings, "restart = \"never\"")]);
        let file = File::options().create(true).append(true).open(&journal).unwrap();
        let stream = file.metadata().unwrap();
        let mut command = place.command(&["launch", config.to_str().unwrap()]);
        command.env("JOURNAL_STREAM", format!("{}:{}", stream.dev(), stream.ino()));
        command.stdout(file.try_clone().unwrap()).stderr(file);
        Running::start(command)
    };
    let read = || std::fs::read_to_string(&journal).unwrap();
    assert_eq!(launch("exit-at-start = 3").end().code(), Some(1));
    assert!(read().contains("<3>module probe.0 did not become ready: ended with 3"), "{}", read());

    let mut running = launch("");
    until("it runs", || read().contains("<5>node main of test runs: 1 module\n"));
    place.say(&["call", "probe.0", "leave", "3"]).ok();
    until("it says so", || read().contains("<5>probe.0 ended with 3"));
    running.signal(Signal::SIGTERM);
    assert_eq!(running.end().code(), Some(1));
    assert!(read().contains("<3>probe.0 failed for good: ended with 3"), "{}", read());
    assert!(read().lines().all(|line| line.starts_with("<5>") || line.starts_with("<3>")), "{}", read());
}

/// Only where systemd is installed; it need not run.
#[test]
fn systemd_understands_the_unit_that_ships() {
    let found = Command::new("systemd-analyze").arg("--version").output();
    if !found.is_ok_and(|output| output.status.success()) {
        return skipped("whether systemd understands the unit (no systemd-analyze here)");
    }
    let place = Place::new();
    let unit = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/rohrpost@.service");
    let text = std::fs::read_to_string(unit).unwrap();
    let text =
        text.replace("/usr/local/bin/rohrpost", env!("CARGO_BIN_EXE_rohrpost")).replace("User=robot", "User=root");
    let file = place.write("rohrpost@main.service", text);
    let said = Command::new("systemd-analyze").args(["verify", "--man=no"]).arg(&file).output().unwrap();
    let words = String::from_utf8_lossy(&said.stderr);
    let ours: Vec<&str> = words.lines().filter(|line| line.contains("rohrpost")).collect();
    assert!(said.status.success() && ours.is_empty(), "{words}");
}
