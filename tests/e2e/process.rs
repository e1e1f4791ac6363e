//! A process of a test, and its output.

use crate::harness::{PATIENCE, assert_has};
use nix::sys::resource::{Resource, setrlimit};
use nix::sys::signal::{SigHandler, Signal, signal};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The output of a command.
#[derive(Debug)]
pub(crate) struct Said {
    /// The command line.
    asked: String,
    pub(crate) out: String,
    pub(crate) err: String,
    pub(crate) code: Option<i32>,
}

impl Said {
    /// It ended well.
    #[track_caller]
    pub(crate) fn ok(self) -> String {
        assert_eq!(self.code, Some(0), "{self:#?}");
        assert_eq!(self.err, "", "{self:#?}");
        self.out
    }

    /// It failed, with words for its user.
    #[track_caller]
    pub(crate) fn fails(self) -> String {
        assert_eq!(self.code, Some(1), "{self:#?}");
        assert!(!self.err.contains("panicked") && !self.err.is_empty(), "{self:#?}");
        self.err
    }

    /// Checks that the program ended well, and has printed these words.
    #[track_caller]
    pub(crate) fn ok_with<const N: usize>(self, words: [&str; N]) {
        assert!(self.code == Some(0) && self.err.is_empty(), "{self:#?}");
        println!("{}", self.asked);
        assert_has(&self.out, words);
    }

    /// Checks that the program failed, and told its user these words.
    #[track_caller]
    pub(crate) fn fails_with<const N: usize>(self, words: [&str; N]) {
        assert!(self.code == Some(1) && !self.err.contains("panicked"), "{self:#?}");
        println!("{}", self.asked);
        assert_has(&self.err, words);
    }

    #[track_caller]
    pub(crate) fn json(self) -> serde_json::Value {
        serde_json::from_str(&self.ok()).unwrap()
    }
}

/// A process with its output.
pub(crate) struct Running {
    /// The command line.
    asked: String,
    child: Child,
    out: Printed,
    err: Printed,
}

/// Output of a pipe so far, and its reading thread.
struct Printed {
    text: Arc<Mutex<String>>,
    reader: Option<std::thread::JoinHandle<()>>,
}

impl Printed {
    fn read(pipe: Option<impl Read + Send + 'static>) -> Self {
        let text = Arc::new(Mutex::new(String::new()));
        let kept = text.clone();
        let reader = pipe.map(|pipe| {
            std::thread::spawn(move || {
                let mut pipe = BufReader::new(pipe);
                let mut line = Vec::new();
                while let Ok(1..) = pipe.read_until(b'\n', &mut line) {
                    kept.lock().unwrap().push_str(&String::from_utf8_lossy(&line));
                    line.clear();
                }
            })
        });
        Self { text, reader }
    }
}

/// A shell that runs tests in the background has them ignore Ctrl-C, `nohup` a terminal that goes, and their children
/// do, too: what is started here would go on then.
fn heeding_signals(command: &mut Command) {
    let heed = || {
        for number in [Signal::SIGINT, Signal::SIGHUP] {
            // SAFETY: a system call between fork and exec; no handler is replaced that anybody waits for.
            unsafe { signal(number, SigHandler::SigDfl) }?;
        }
        Ok(())
    };
    // SAFETY: as above.
    unsafe { command.pre_exec(heed) };
}

/// Takes the right to real-time scheduling from a command, even if root runs the tests.
pub(crate) fn without_real_time(command: &mut Command) {
    const CAP_SYS_NICE: nix::libc::c_ulong = 23;
    let give_up = || {
        // SAFETY: a system call with a number; it touches no memory. Without root there is no such right, and the call
        // fails.
        unsafe { nix::libc::prctl(nix::libc::PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0) };
        setrlimit(Resource::RLIMIT_RTPRIO, 0, 0)?;
        Ok(())
    };
    // SAFETY: between fork and exec it makes two system calls and nothing else.
    unsafe { command.pre_exec(give_up) };
}

impl Running {
    pub(crate) fn start(mut command: Command) -> Self {
        let asked = format!("{command:?}");
        heeding_signals(&mut command);
        let mut child = command.spawn().unwrap();
        let (out, err) = (Printed::read(child.stdout.take()), Printed::read(child.stderr.take()));
        Self { asked, child, out, err }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn out(&self) -> String {
        self.out.text.lock().unwrap().clone()
    }

    pub(crate) fn err(&self) -> String {
        self.err.text.lock().unwrap().clone()
    }

    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().unwrap()
    }

    #[track_caller]
    pub(crate) fn assert_runs(&mut self) {
        if let Some(status) = self.ended() {
            panic!("it ended with {status}\n{}\n{}", self.out(), self.err());
        }
    }

    /// Waits until it has printed this.
    #[track_caller]
    pub(crate) fn wait_for(&mut self, text: &str) {
        let start = Instant::now();
        while !self.out().contains(text) {
            assert!(start.elapsed() < PATIENCE, "never printed `{text}`:\n{}\n{}", self.out(), self.err());
            assert!(self.ended().is_none() || self.out().contains(text), "{}\n{}", self.out(), self.err());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Whether it already handles Ctrl-C, instead of dying of it.
    pub(crate) fn heeds_control_c(&self) -> bool {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.pid())).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        caught & 1 << (Signal::SIGINT as u32 - 1) != 0
    }

    pub(crate) fn signal(&self, number: Signal) {
        crate::harness::signal(self.pid(), number);
    }

    /// Waits for its end, and for all it has printed.
    #[track_caller]
    pub(crate) fn end(&mut self) -> ExitStatus {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.ended() {
                break status;
            }
            assert!(start.elapsed() < PATIENCE, "does not end:\n{}\n{}", self.out(), self.err());
            std::thread::sleep(Duration::from_millis(5));
        };
        for printed in [&mut self.out, &mut self.err] {
            // A process that outlives it may hold the pipe; its output is not awaited.
            let deadline = Instant::now() + Duration::from_secs(5);
            while printed.reader.as_ref().is_some_and(|reader| !reader.is_finished()) && Instant::now() < deadline {
                std::thread::sleep(Duration::from_millis(2));
            }
            printed.reader = None;
        }
        status
    }

    /// All output, to its end.
    #[track_caller]
    pub(crate) fn said(mut self) -> Said {
        let status = self.end();
        Said { asked: self.asked.clone(), out: self.out(), err: self.err(), code: status.code() }
    }

    /// Kills it, and waits for its end.
    #[track_caller]
    pub(crate) fn kill(&mut self) {
        self.signal(Signal::SIGKILL);
        self.end();
    }

    /// Stops it as Ctrl-C would: it ends with a failure, since something of it has failed.
    #[track_caller]
    pub(crate) fn stop_failed(&mut self) {
        self.signal(Signal::SIGINT);
        assert_eq!(self.end().code(), Some(1), "{}\n{}", self.out(), self.err());
    }

    /// Stops it as Ctrl-C would, and what it has printed.
    #[track_caller]
    pub(crate) fn stop(&mut self) -> String {
        self.signal(Signal::SIGINT);
        let status = self.end();
        assert!(status.success(), "{status}\n{}\n{}", self.out(), self.err());
        self.out()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("{} said:\n{}{}", self.asked, self.out(), self.err());
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
