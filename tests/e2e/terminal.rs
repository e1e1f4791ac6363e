//! A terminal of its own for a command, with a screen and a keyboard.

use crate::harness::{PATIENCE, Place, until};
use crate::process::Running;
use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{Winsize, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::signal::Signal;
use nix::sys::termios::{LocalFlags, tcgetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

nix::ioctl_write_ptr_bad!(set_size, nix::libc::TIOCSWINSZ, Winsize);

/// The reader of the screen checks this often whether the terminal is being closed, ms.
const LOOK_MS: u16 = 20;

/// A terminal, and its content.
pub(crate) struct Terminal {
    master: File,
    seen: Arc<Mutex<Seen>>,
    closing: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

struct Seen {
    /// All output so far.
    drawn: String,
    /// The screen after this output.
    parser: vt100::Parser,
}

const fn size(rows: u16, columns: u16) -> Winsize {
    Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }
}

/// Both ends of a new pseudo-terminal, and the path of the second.
pub(crate) fn open_pair() -> (File, File, String) {
    // Not by `openpty`: processes of other tests would inherit its files and keep them open.
    let master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let (path, no_session) = (ptsname_r(&master).unwrap(), nix::libc::O_NOCTTY);
    let slave = File::options().read(true).write(true).custom_flags(no_session).open(&path).unwrap();
    (File::from(OwnedFd::from(master)), slave, path)
}

impl Terminal {
    /// Starts a command in it.
    pub(crate) fn start(place: &Place, arguments: &[&str], rows: u16, columns: u16) -> (Self, Running) {
        let (master, slave, _) = open_pair();
        // SAFETY: the file is open, and the size lives for the call.
        unsafe { set_size(master.as_raw_fd(), &size(rows, columns)) }.unwrap();
        let mut command = place.command(arguments);
        let end = || Stdio::from(slave.try_clone().unwrap());
        command.stdin(end()).stdout(end()).stderr(end()).env_remove("NO_COLOR").env("TERM", "xterm-256color");
        let running = Running::start(command);
        let number = |number| NonZeroU16::new(number).unwrap();
        let parser = vt100::Parser::new(number(rows), number(columns), 0);
        let seen = Arc::new(Mutex::new(Seen { drawn: String::new(), parser }));
        let closing = Arc::new(AtomicBool::new(false));
        let (screen, kept, stop) = (master.try_clone().unwrap(), seen.clone(), closing.clone());
        let reader = Some(std::thread::spawn(move || read(screen, &kept, &stop)));
        (Self { master, seen, closing, reader }, running)
    }

    /// All that was drawn so far.
    pub(crate) fn drawn(&self) -> String {
        self.seen.lock().unwrap().drawn.clone()
    }

    /// The screen as it is now.
    pub(crate) fn screen(&self) -> String {
        self.seen.lock().unwrap().parser.screen().contents()
    }

    /// Waits until something was drawn, whatever it is now.
    pub(crate) fn wait_for(&self, words: &str) {
        until(format!("`{words}` on the screen"), || self.drawn().contains(words));
    }

    /// Waits for a screen, and fails with the present one.
    #[track_caller]
    pub(crate) fn wait_screen(&self, what: &str, is_it: impl Fn(&str) -> bool) -> String {
        let start = std::time::Instant::now();
        loop {
            let screen = self.screen();
            if is_it(&screen) {
                return screen;
            }
            assert!(start.elapsed() < PATIENCE, "never on the screen: {what}\n{screen}");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }

    /// Waits until the line of the table that begins with this module holds all of these words.
    #[track_caller]
    pub(crate) fn wait_row(&self, module: &str, words: &[&str]) {
        let holds = |line: &str| {
            let mut cells = line.trim_start_matches('>').split_whitespace();
            cells.next() == Some(module) && words.iter().all(|word| line.split_whitespace().any(|cell| cell == *word))
        };
        self.wait_screen(&format!("{module} with {words:?}"), |screen| screen.lines().any(holds));
    }

    /// Types.
    pub(crate) fn keys(&self, keys: &str) {
        (&self.master).write_all(keys.as_bytes()).unwrap();
    }

    pub(crate) fn resize(&self, running: &Running, rows: u16, columns: u16) {
        let number = |number| NonZeroU16::new(number).unwrap();
        self.seen.lock().unwrap().parser.screen_mut().set_size(number(rows), number(columns));
        // SAFETY: the file is open, and the size lives for the call.
        unsafe { set_size(self.master.as_raw_fd(), &size(rows, columns)) }.unwrap();
        // The kernel only notifies processes that have it as their controlling terminal.
        running.signal(Signal::SIGWINCH);
    }

    /// Whether it is in a shell's mode: the usual screen, a cursor, letters echoed and lines edited.
    #[track_caller]
    pub(crate) fn assert_restored(&self) {
        let left = |seen: &Seen| !seen.parser.screen().alternate_screen() && !seen.parser.screen().hide_cursor();
        until("the usual screen and a cursor", || left(&self.seen.lock().unwrap()));
        let flags = tcgetattr(self.master.as_fd()).unwrap().local_flags;
        assert!(flags.contains(LocalFlags::ECHO | LocalFlags::ICANON | LocalFlags::ISIG), "{flags:?}");
    }

    /// All that was drawn, once nobody has it open any more.
    pub(crate) fn into_all_drawn(mut self) -> String {
        self.reader.take().unwrap().join().unwrap();
        self.drawn()
    }

    /// Closes it while the command runs.
    pub(crate) fn close(mut self) {
        self.closing.store(true, Ordering::Release);
        self.reader.take().unwrap().join().unwrap();
    }
}

fn read(mut screen: File, seen: &Mutex<Seen>, stop: &AtomicBool) {
    let mut bytes = [0; 4096];
    while !stop.load(Ordering::Acquire) {
        let mut ready = [PollFd::new(screen.as_fd(), PollFlags::POLLIN)];
        if poll(&mut ready, PollTimeout::from(LOOK_MS)).is_ok_and(|count| count == 0) {
            continue;
        }
        let Ok(count @ 1..) = screen.read(&mut bytes) else { return };
        let mut seen = seen.lock().unwrap();
        seen.drawn.push_str(&String::from_utf8_lossy(&bytes[..count]));
        seen.parser.process(&bytes[..count]);
    }
}
