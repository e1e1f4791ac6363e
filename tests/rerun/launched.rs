//! A robot of one configuration file, from its launch to its end.

use super::programs::ok;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// It ends with the test, also with one that fails.
pub(crate) struct Launched {
    folder: PathBuf,
    launch: Child,
}

impl Launched {
    /// Launches a configuration file of this folder.
    pub(crate) fn start(folder: &Path, config: &str) -> Self {
        let said = |name| File::create(folder.join(name)).unwrap();
        let launch =
            command(folder, &["launch", config]).stdout(said("launch.out")).stderr(said("launch.err")).spawn().unwrap();
        Self { folder: folder.into(), launch }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.launch.id()
    }

    /// Runs a tool to its end.
    pub(crate) fn tool(&self, arguments: &[&str]) -> Output {
        command(&self.folder, arguments).output().unwrap()
    }

    /// The bridge's counts, if it is there.
    pub(crate) fn count(&self, name: &str) -> Option<u64> {
        let counts = self.tool(&["call", "gui.0", "counts", "--json"]);
        let counts: serde_json::Value = serde_json::from_slice(&counts.stdout).ok()?;
        counts[name].as_u64()
    }

    /// Ends it in order; returns its output.
    pub(crate) fn end(mut self) -> String {
        self.ask();
        let status = self.launch.wait().unwrap();
        let said = |name| std::fs::read(self.folder.join(name)).unwrap();
        ok("launch", &Output { status, stdout: said("launch.out"), stderr: said("launch.err") })
    }

    fn ask(&self) {
        // It may have ended already.
        let _ = kill(Pid::from_raw(self.launch.id() as i32), Signal::SIGTERM);
    }
}

impl Drop for Launched {
    fn drop(&mut self) {
        if self.launch.try_wait().is_ok_and(|ended| ended.is_some()) {
            return;
        }
        // Asked to end first, so that its modules end; then killed.
        self.ask();
        let start = Instant::now();
        while self.launch.try_wait().is_ok_and(|ended| ended.is_none()) && start.elapsed() < super::robot::PATIENCE {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.launch.kill();
        let _ = self.launch.wait();
    }
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rohrpost"));
    command.args(arguments).env("ROHRPOST_DIR", folder.join("nodes")).current_dir(folder).stdin(Stdio::null());
    command
}
