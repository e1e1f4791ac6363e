//! Launch as systemd starts it: what it tells the service manager, and when it falls silent.

use crate::harness::{Place, halt, probe, signal, wait};
use crate::process::Running;
use nix::sys::signal::Signal;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// What systemd does: it listens at a socket, and notes what comes.
struct Manager {
    socket: UnixDatagram,
    said: Vec<String>,
}

impl Manager {
    fn new(socket: UnixDatagram) -> Self {
        socket.set_nonblocking(true).unwrap();
        Self { socket, said: Vec::new() }
    }

    /// Lines that came since this was last asked.
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
        wait("it is starting", || manager.has("STATUS=starts the modules of node main").then_some(()));
        wait("it is ready", || {
            launch.assert_runs();
            manager.has("READY=1").then_some(())
        });
        let robot = place.robot(&place.path("test.toml"), "main", &mut launch);
        assert_eq!((robot.state("probe.0"), robot.state("probe.1")), ("on", "on"), "not before all are on");
        assert!(manager.has("STATUS=2 modules run"), "{:?}", manager.said);
        for count in 1..=3 {
            wait(format!("ping {count}"), || (manager.pings() >= count).then_some(()));
        }
        place.say(&["stop", "probe.1"]).ok();
        wait("it is told who does not run", || manager.has("STATUS=1 modules run, probe.1 stopped").then_some(()));
        assert!(!manager.has("STOPPING=1"));
        drop(robot);
        launch.stop();
        assert!(manager.has("STOPPING=1"), "{:?}", manager.said);
        std::fs::remove_file(place.path("record")).unwrap();
    }
}

#[test]
fn a_launch_that_hangs_is_silent() {
    let place = Place::new();
    let path = place.path("notify");
    let mut manager = Manager::new(UnixDatagram::bind(&path).unwrap());
    let period = Duration::from_millis(200);
    let mut launch = launch(&place, &[&probe("probe.0", "", "")], path.to_str().unwrap(), 200);
    wait("it pings", || (manager.pings() >= 2).then_some(()));
    halt(launch.pid());
    manager.hear();
    std::thread::sleep(3 * period);
    assert_eq!(manager.hear(), 0, "a process that stands says nothing");
    signal(launch.pid(), Signal::SIGCONT);
    wait("it pings again", || (manager.hear() > 0).then_some(()));
    launch.stop();
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
    wait("the queue is full", || full.send_to(b"x", &path).is_err().then_some(()));
    let pid = robot.pid("probe.0");
    signal(pid, Signal::SIGKILL);
    robot.wait_restarted("probe.0", pid);
    drop(robot);
    launch.stop();
    drop(socket);
}

#[test]
fn what_it_says_to_the_journal_begins_with_its_urgency() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "exit-at-start = 3", "restart = \"never\"")]);
    let file = std::fs::File::create(place.path("journal")).unwrap();
    let metadata = std::os::unix::fs::MetadataExt::ino(&file.metadata().unwrap());
    let device = std::os::unix::fs::MetadataExt::dev(&file.metadata().unwrap());
    let mut command = place.command(&["launch", config.to_str().unwrap()]);
    command.env("JOURNAL_STREAM", format!("{device}:{metadata}")).stdout(Stdio::from(file));
    let mut launch = Running::start(command);
    assert_eq!(launch.end().code(), Some(1));
    let config = place.config(&[&probe("probe.0", "", "")]);
    let file = std::fs::File::options().append(true).open(place.path("journal")).unwrap();
    let mut command = place.command(&["launch", config.to_str().unwrap()]);
    command.env("JOURNAL_STREAM", format!("{device}:{metadata}")).stdout(Stdio::from(file));
    let mut launch = Running::start(command);
    let read = || std::fs::read_to_string(place.path("journal")).unwrap();
    wait("it runs", || read().contains("<5>node main of test runs: 1 module\n").then_some(()));
    launch.signal(Signal::SIGTERM);
    assert!(launch.end().success());
    assert!(read().lines().all(|line| line.starts_with("<5>")), "{}", read());
}

/// Only where systemd is installed; it need not run.
#[test]
fn systemd_understands_the_unit_that_ships() {
    let found = Command::new("systemd-analyze").arg("--version").output();
    if !found.is_ok_and(|output| output.status.success()) {
        return;
    }
    let place = Place::new();
    let unit = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/rohrpost@.service");
    let text = std::fs::read_to_string(unit).unwrap();
    let text =
        text.replace("/usr/local/bin/rohrpost", env!("CARGO_BIN_EXE_rohrpost")).replace("User=robot", "User=root");
    let file = place.path("rohrpost@main.service");
    std::fs::write(&file, text).unwrap();
    let said = Command::new("systemd-analyze").args(["verify", "--man=no"]).arg(&file).output().unwrap();
    let words = String::from_utf8_lossy(&said.stderr);
    let ours: Vec<&str> = words.lines().filter(|line| line.contains("rohrpost")).collect();
    assert!(said.status.success() && ours.is_empty(), "{words}");
}
