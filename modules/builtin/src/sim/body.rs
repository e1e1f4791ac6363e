//! The body of a robot in an arena: commands for its wheels go there by datagram, and each of its moments comes back.
//!
//! What waits between the two is the kernel's: neither can keep the other from its work.

use rohrpost_modules::runtime::Context;
use rohrpost_modules::types::Twist;
use rohrpost_modules::wire::{append, from_bytes};
use rohrpost_robot::arena::Drive;
use rohrpost_robot::simulator::Moment;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// No moment takes more bytes than this: seven numbers of at most ten bytes.
const MOMENT_BYTES_MAX: usize = 80;

/// The arena has been silent for longer than the motor's dead-man time.
#[derive(Debug, Error)]
#[error("{} is silent: start the arena (`rohrpost arena FILE`)", .0.display())]
pub(super) struct Silent(PathBuf);

/// The way to the arena.
pub(super) struct Body {
    socket: UnixDatagram,
    arena: PathBuf,
    patience_ns: u64,
    /// When the newest moment came, ns of the monotonic clock.
    heard_ns: u64,
}

impl Body {
    /// Takes the place of the body of this name before it, which has ended.
    pub(super) fn open(context: &mut Context, arena: PathBuf, patience_ns: u64) -> io::Result<Self> {
        let own = body_path(&arena, &context.installation().classes.format(context.me()));
        let heard_ns = context.clock().monotonic_ns();
        let socket = context.open_outside(|| {
            remove(&own)?;
            let socket = UnixDatagram::bind(&own)?;
            socket.set_nonblocking(true)?;
            Ok(socket)
        })?;
        Ok(Self { socket, arena, patience_ns, heard_ns })
    }

    /// The wheels are to reach this motion, from `now_ns` on.
    pub(super) fn drive(&self, now_ns: u64, twist: Twist) -> Result<(), Silent> {
        let mut bytes = Vec::new();
        // What does not reach the arena is told by its silence.
        if append(&mut bytes, &Drive { at_ns: now_ns, twist }).is_ok() {
            let _ = self.socket.send_to(&bytes, &self.arena);
        }
        self.hears(now_ns)
    }

    /// The newest moment that has come since the last call.
    pub(super) fn newest(&mut self, context: &Context, now_ns: u64) -> Option<Moment> {
        let newest = context.take_in(|| {
            let (mut bytes, mut newest) = ([0; MOMENT_BYTES_MAX], Vec::new());
            while let Ok(count) = self.socket.recv(&mut bytes) {
                newest = bytes[..count].to_vec();
            }
            Ok(newest)
        });
        let moment = from_bytes(&newest.ok()?).ok()?;
        self.heard_ns = now_ns;
        Some(moment)
    }

    /// Whether the arena has told something lately.
    pub(super) fn hears(&self, now_ns: u64) -> Result<(), Silent> {
        let is_silent = now_ns.saturating_sub(self.heard_ns) > self.patience_ns;
        if is_silent { Err(Silent(self.arena.clone())) } else { Ok(()) }
    }
}

/// Removes a socket that a killed process has left, and nothing else.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    if path.symlink_metadata().is_ok_and(|there| !there.file_type().is_socket()) {
        let why = "it is no socket; name another path as `arena`, or remove it by hand";
        return Err(io::Error::new(io::ErrorKind::AlreadyExists, why));
    }
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The socket of the body of this name, beside that of its arena.
pub(crate) fn body_path(arena: &Path, name: &str) -> PathBuf {
    let mut path = arena.as_os_str().to_owned();
    path.push(".");
    path.push(name);
    path.into()
}
