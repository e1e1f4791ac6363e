//! One connection of log control. Nothing here waits for it.

use rohrpost::{Context, Interest, Watch};
use rohrpost_recording::{CONTROL_LINE_BYTES_MAX, ControlAnswer, ControlCommand, ControlError, ControlLines};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// A connection. At any time it waits for one thing: a command, the answer to it, or that the answer is taken.
pub(super) struct ControlClient {
    socket: TcpStream,
    lines: ControlLines,
    /// Of an answer that was not taken at once.
    rest: Vec<u8>,
    /// It waits for the answer to this order.
    order: Option<u32>,
    watch: Option<(Watch, Interest)>,
    /// It says nothing more, but may wait for answers.
    has_ended: bool,
    is_broken: bool,
    /// When it said something, or took some of an answer.
    heard: Instant,
}

impl ControlClient {
    pub(super) fn new(socket: TcpStream, now: Instant) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        Ok(Self {
            socket,
            lines: ControlLines::default(),
            rest: Vec::new(),
            order: None,
            watch: None,
            has_ended: false,
            is_broken: false,
            heard: now,
        })
    }

    pub(super) fn is_watched_by(&self, watch: Watch) -> bool {
        self.watch.is_some_and(|(its, _)| its == watch)
    }

    /// For so long nothing came, no answer was taken, and no order is under way.
    pub(super) fn silent(&self, now: Instant) -> Duration {
        if self.order.is_some() { Duration::ZERO } else { now.saturating_duration_since(self.heard) }
    }

    /// It did not take all of its answer yet.
    #[cfg(test)]
    pub(super) fn has_rest(&self) -> bool {
        !self.rest.is_empty()
    }

    /// The order that it waits for.
    pub(super) fn order(&self) -> Option<u32> {
        self.order
    }

    pub(super) fn wait_for(&mut self, order: u32) {
        self.order = Some(order);
    }

    /// Reads and writes what goes without waiting.
    pub(super) fn move_bytes(&mut self, now: Instant) {
        if self.is_free() && !self.has_ended {
            self.read(now);
        }
        self.write(now);
    }

    fn is_free(&self) -> bool {
        self.rest.is_empty() && self.order.is_none()
    }

    /// Once: what is left comes with the next call, after the others' turn.
    fn read(&mut self, now: Instant) {
        let mut bytes = [0; CONTROL_LINE_BYTES_MAX];
        let room = self.lines.room();
        match self.socket.read(&mut bytes[..room]) {
            Ok(0) => self.has_ended = room > 0,
            Ok(count) => {
                self.lines.put(&bytes[..count]);
                self.heard = now;
            }
            Err(error) => self.note(&error),
        }
    }

    /// The next command, as soon as the one before is answered and the answer taken.
    pub(super) fn next_command(&mut self) -> Option<Result<ControlCommand, ControlError>> {
        let command = if self.is_free() && !self.is_broken { self.lines.next_command() } else { None };
        if matches!(command, Some(Err(ControlError::Http))) {
            // What is behind it is from a web page, too.
            self.has_ended = true;
            self.lines = ControlLines::default();
        }
        command
    }

    pub(super) fn answer(&mut self, answer: &ControlAnswer, now: Instant) {
        self.order = None;
        self.rest.extend_from_slice(answer.line().as_bytes());
        self.rest.push(b'\n');
        self.write(now);
    }

    fn write(&mut self, now: Instant) {
        while !self.rest.is_empty() && !self.is_broken {
            match self.socket.write(&self.rest) {
                Ok(0) => self.is_broken = true,
                Ok(count) => {
                    self.rest.drain(..count);
                    self.heard = now;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => self.note(&error),
            }
        }
    }

    fn note(&mut self, error: &io::Error) {
        self.is_broken |= !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted);
    }

    /// Asks the runtime for what is waited for now; false when the connection is over.
    pub(super) fn watch(&mut self, context: &mut Context) -> bool {
        let wanted = match () {
            () if self.is_broken => return false,
            () if !self.rest.is_empty() => Some(Interest::Write),
            // Its order goes on, whether it listens or not.
            () if self.order.is_some() => None,
            () if self.has_ended => return false,
            () => Some(Interest::Read),
        };
        if self.watch.map(|(_, interest)| interest) == wanted {
            return true;
        }
        self.forget(context);
        let Some(interest) = wanted else { return true };
        self.watch = context.watch(&self.socket, interest).ok().map(|watch| (watch, interest));
        self.watch.is_some()
    }

    /// Has the runtime wait for it no longer.
    pub(super) fn forget(&mut self, context: &mut Context) {
        if let Some((watch, _)) = self.watch.take() {
            context.unwatch(watch);
        }
    }
}
