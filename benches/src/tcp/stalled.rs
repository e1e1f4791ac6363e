//! A session that sends keep-alives, receives packages, and reads none.

use super::pace::Pace;
use nix::sys::socket::{setsockopt, sockopt};
use rohrpost_bench_local::harness::{Failure, OrFail};
use rohrpost_routers::session::frame::SessionMessage;
use rohrpost_routers::tcp::{Moved, Stream};

/// Period of packages to it: a MiB a second.
const BYTES: usize = 1024;
const EACH_NS: u64 = 1_000_000;
/// After 3.5 s of silence it would be closed.
const ALIVE_EACH_NS: u64 = 500_000_000;
/// Its receive buffer in the kernel; small, so that it stalls soon.
const KEPT_BYTES: usize = 16 * 1024;
const PIECE_BYTES: usize = 64 * 1024;

pub(super) struct Stalled {
    stream: Stream,
    packages: Pace,
    signs: Pace,
    body: [u8; BYTES],
    sent: u64,
}

impl Stalled {
    pub(super) fn new(stream: Stream, now_ns: u64) -> Result<Self, Failure> {
        setsockopt(&stream, sockopt::RcvBuf, &KEPT_BYTES).or_fail("receive buffer")?;
        let (packages, signs) = (Pace::new(now_ns, EACH_NS), Pace::new(now_ns, ALIVE_EACH_NS));
        Ok(Self { stream, packages, signs, body: [0; BYTES], sent: 0 })
    }

    /// Number of the next package to send to it, if one is due. Also sends keep-alives.
    pub(super) fn next_due(&mut self, now_ns: u64) -> Result<Option<u64>, Failure> {
        if self.signs.next_due(now_ns).is_some() {
            let mut sign = Vec::new();
            SessionMessage::Ask(now_ns).write(&mut sign);
            if let Moved::Over(_) = self.stream.write(&sign, false) {
                return Err(Failure::Failed("the stalled session was closed before the turn was over".into()));
            }
        }
        let due = self.packages.next_due(now_ns);
        self.sent += u64::from(due.is_some());
        Ok(due.map(|(number, _)| number))
    }

    /// Of a package to it.
    pub(super) fn body(&mut self) -> &mut [u8] {
        &mut self.body
    }

    /// It must have stalled: fewer bytes arrived at its socket than were sent.
    pub(super) fn check(mut self) -> Result<(), Failure> {
        let (mut piece, mut came) = (vec![0; PIECE_BYTES], 0);
        // Bytes still in the kernel; more does not follow at once.
        while let Moved::Bytes(bytes) = self.stream.read(&mut piece) {
            came += bytes as u64;
        }
        let sent = self.sent * BYTES as u64;
        if came < sent / 2 {
            return Ok(());
        }
        Err(Failure::Failed(format!("the stalling session got {came} of {sent} bytes")))
    }
}
