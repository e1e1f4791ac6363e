//! The live table, in a terminal of its own.

use crate::harness::{Place, probe, runs, wait};
use crate::process::Running;
use nix::pty::{OpenptyResult, Winsize, openpty};
use nix::sys::signal::Signal;
use std::fs::File;
use std::io::Read;
use std::os::fd::AsRawFd;
use std::process::Stdio;
use std::sync::{Arc, Mutex};

nix::ioctl_write_ptr_bad!(set_size, nix::libc::TIOCSWINSZ, Winsize);

/// A terminal, and what was drawn on it.
struct Terminal {
    keyboard: Option<File>,
    drawn: Arc<Mutex<String>>,
}

const fn size(rows: u16, columns: u16) -> Winsize {
    Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }
}

impl Terminal {
    /// Starts a command in it.
    fn start(place: &Place, arguments: &[&str]) -> (Self, Running) {
        let OpenptyResult { master, slave } = openpty(&size(24, 100), None).unwrap();
        let mut command = place.command(arguments);
        command.stdout(Stdio::from(slave.try_clone().unwrap())).stderr(Stdio::from(slave));
        let running = Running::start(command);
        let keyboard = File::from(master);
        let mut screen = keyboard.try_clone().unwrap();
        let drawn = Arc::new(Mutex::new(String::new()));
        let kept = drawn.clone();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = screen.read(&mut bytes) {
                kept.lock().unwrap().push_str(&String::from_utf8_lossy(&bytes[..count]));
            }
        });
        (Self { keyboard: Some(keyboard), drawn }, running)
    }

    fn drawn(&self) -> String {
        self.drawn.lock().unwrap().clone()
    }

    fn wait_for(&self, words: &str) {
        wait(format!("`{words}` on the screen"), || self.drawn().contains(words).then_some(()));
    }

    fn resize(&self, rows: u16, columns: u16) {
        let keyboard = self.keyboard.as_ref().unwrap();
        // SAFETY: the file is open, and the size lives for the call.
        unsafe { set_size(keyboard.as_raw_fd(), &size(rows, columns)) }.unwrap();
    }
}

#[test]
fn a_terminal_shows_a_live_table() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", ""), &probe("probe.1", "", "start = \"off\"")]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()]);
    for words in ["module", "priority", "probe.0", "probe.1", "restarts"] {
        terminal.wait_for(words);
    }
    for (rows, columns) in [(1, 1), (3, 10), (200, 500), (24, 80)] {
        terminal.resize(rows, columns);
        launch.signal(Signal::SIGWINCH);
        let before = terminal.drawn().len();
        wait("it is drawn again", || (terminal.drawn().len() > before + 200).then_some(()));
    }
    let robot = place.robot(&config, "main", &mut launch);
    let pid = robot.pid("probe.0");
    crate::harness::signal(pid, Signal::SIGKILL);
    terminal.wait_for("probe.0 was killed by signal 9; starts again in");
    robot.wait_restarted("probe.0", pid);
    drop(robot);
    launch.signal(Signal::SIGINT);
    assert!(launch.end().success(), "{}", terminal.drawn());
    assert!(!terminal.drawn().contains("panicked"), "{}", terminal.drawn());
    place.assert_empty();
}

#[test]
fn a_closed_terminal_hurts_nobody() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let (mut terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()]);
    terminal.wait_for("probe.0");
    let robot = place.robot(&config, "main", &mut launch);
    robot.wait_on(&mut launch);
    let pid = robot.pid("probe.0");
    drop(terminal.keyboard.take());
    drop(terminal);
    // It works on, unseen, until it is told to stop: a session of its own would be sent SIGHUP, see `launch.rs`.
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    crate::harness::signal(pid, Signal::SIGKILL);
    robot.wait_restarted("probe.0", pid);
    let pid = robot.pid("probe.0");
    drop(robot);
    launch.signal(Signal::SIGINT);
    assert!(launch.end().success());
    assert!(!runs(pid));
    place.assert_empty();
}

#[test]
fn what_does_not_go_to_a_terminal_holds_no_table() {
    let place = Place::new();
    let (mut launch, _robot) = place.launched(&[&probe("probe.0", "", "")]);
    assert_eq!(launch.stop(), "", "nothing happened, so there is nothing to say");
}
