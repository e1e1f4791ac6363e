//! zenoh through its router, as a peer. Its programs are a package of their own (`benches/zenoh`), so that zenoh is
//! only compiled on demand.

use super::systems::free_address;
use rohrpost_bench_local::harness::{Cell, Child, Failure, OrFail, Scratch, look_for};
use std::fs::{self, File};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// The program; it stands beside this one.
pub const PROGRAM: &str = "rohrpost-bench-zenoh";
/// The last of its lines starts with this.
const END: &str = "end";
const READY_WITHIN: Duration = Duration::from_secs(20);
const GRACE: Duration = Duration::from_secs(20);
const LOOK_EACH: Duration = Duration::from_millis(10);

/// One way through zenoh's router, µs.
///
/// # Errors
/// [`Failure::Skipped`] when the program was not built; else what it failed with.
pub fn time_zenoh(cell: &Cell) -> Result<Vec<f64>, Failure> {
    let program = program()?;
    let (address, scratch) = (free_address()?, Scratch::new()?);
    let locator = format!("tcp/{address}");
    let bytes = cell.bytes.to_string();
    let _router = start(&program, &["router", &locator], &scratch, "router")?;
    await_listening(address)?;
    let _pong = start(&program, &["pong", &locator], &scratch, "pong")?;
    let (messages, warm_up) = (cell.messages.to_string(), cell.warm_up.to_string());
    let cap_ms = cell.cap.as_millis().to_string();
    let arguments = ["ping", &locator, &bytes, &messages, &warm_up, &cap_ms];
    let mut ping = start(&program, &arguments, &scratch, "ping")?;
    look_for(cell.cap + GRACE, LOOK_EACH, || Ok(ping.has_ended()?.then_some(())))?;
    let said = fs::read_to_string(said(&scratch, "ping")).unwrap_or_default();
    let mut lines: Vec<&str> = said.lines().collect();
    if lines.pop() != Some(END) {
        return Err(Failure::Failed(format!("zenoh's ping did not end: {said}")));
    }
    lines.iter().map(|line| line.parse::<f64>().or_fail(line)).collect()
}

fn program() -> Result<PathBuf, Failure> {
    let own = std::env::current_exe().or_fail("this program")?;
    let path = own.with_file_name(PROGRAM);
    let how = "cargo build --release --manifest-path benches/zenoh/Cargo.toml --target-dir target";
    if path.is_file() { Ok(path) } else { Err(Failure::Skipped(format!("no {}; {how}", path.display()))) }
}

fn start(program: &Path, arguments: &[&str], scratch: &Scratch, name: &str) -> Result<Child, Failure> {
    Child::start(|| {
        let said = File::create(said(scratch, name)).or_fail(name)?;
        let errors = said.try_clone().or_fail(name)?;
        let error = Command::new(program).args(arguments).stdin(Stdio::null()).stdout(said).stderr(errors).exec();
        Err(Failure::of(PROGRAM, error))
    })
}

fn said(scratch: &Scratch, name: &str) -> PathBuf {
    scratch.directory().join(name)
}

fn await_listening(address: SocketAddr) -> Result<(), Failure> {
    let listens = look_for(READY_WITHIN, LOOK_EACH, || Ok(TcpStream::connect(address).ok()))?;
    listens.map(drop).ok_or_else(|| Failure::Failed("zenoh's router does not listen".into()))
}
