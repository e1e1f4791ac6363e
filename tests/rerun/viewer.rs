//! A viewer with faults, and the data that it received.
//!
//! It is Rerun's proxy: the server that is also inside of each viewer, and what a bridge connects to, without the
//! window.

use super::programs::{rerun, rows};
use super::robot::{PATIENCE, wait};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A port that nobody uses now.
pub(crate) fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

pub(crate) struct Viewer {
    process: Child,
    port: u16,
}

impl Viewer {
    /// Starts one and waits until it listens.
    pub(crate) fn start(port: u16) -> Self {
        let process = quiet(&["--serve-grpc", "--bind", "127.0.0.1", "--server-memory-limit", "64MB"])
            .args(["--port", &port.to_string()])
            .spawn()
            .unwrap();
        wait("the viewer listens", || TcpStream::connect(("127.0.0.1", port)).ok());
        Self { process, port }
    }

    pub(crate) fn freeze(&self) {
        self.signal(Signal::SIGSTOP);
    }

    pub(crate) fn go_on(&self) {
        self.signal(Signal::SIGCONT);
    }

    fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.process.id() as i32), signal).unwrap();
    }

    /// Reads its data until these entities are there, and so many below one of them.
    #[track_caller]
    pub(crate) fn shows(&self, folder: &Path, entities: &[&str], (below, many): (&str, usize)) {
        let file = folder.join("seen.rrd");
        let _ = std::fs::remove_file(&file);
        let mut reader = quiet(&["--save", file.to_str().unwrap(), "--connect"])
            .arg(format!("rerun+http://127.0.0.1:{}/proxy", self.port))
            .spawn()
            .unwrap();
        let start = Instant::now();
        let seen = loop {
            // It is still being written, so what is last in it may be torn.
            let printed =
                Command::new(rerun()).args(["rrd", "print"]).arg(&file).env("NO_COLOR", "1").output().unwrap();
            let rows = rows(&String::from_utf8_lossy(&printed.stdout));
            let count = |entity: &str| rows.keys().filter(|name| name.starts_with(entity)).count();
            if entities.iter().all(|entity| count(entity) > 0) && count(below) == many {
                break Ok(());
            }
            if start.elapsed() > PATIENCE {
                break Err(rows);
            }
            std::thread::sleep(Duration::from_millis(100));
        };
        let _ = reader.kill();
        let _ = reader.wait();
        seen.unwrap_or_else(|rows| {
            panic!("the viewer never got all of {entities:?} and {many} {below}, but {rows:#?}")
        });
    }
}

impl Drop for Viewer {
    /// Kills it, as a crash would.
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn quiet(arguments: &[&str]) -> Command {
    let mut command = Command::new(rerun());
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}
