//! One connection of log control. Nothing here waits for it.

use rohrpost::{Context, Interest, Watch};
use rohrpost_recording::{CONTROL_LINE_BYTES_MAX, ControlAnswer, ControlCommand, ControlError, ControlLines};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// A command comes, and an answer is taken, within this time; else the connection ends. So one that is slow or silent
/// gives its place back.
pub(super) const WITHIN: Duration = Duration::from_secs(30);

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
    /// Since when a command is to come, or an answer to be taken.
    since: Instant,
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
            since: now,
        })
    }

    pub(super) fn is_watched_by(&self, watch: Watch) -> bool {
        self.watch.is_some_and(|(its, _)| its == watch)
    }

    /// Ends it if it took too long. An order that is under way takes as long as the disk does.
    pub(super) fn look(&mut self, now: Instant) {
        if self.order.is_some() || now.saturating_duration_since(self.since) < WITHIN {
            return;
        }
        if self.rest.is_empty() && !self.has_ended {
            let s = WITHIN.as_secs();
            self.answer(&ControlAnswer::err(&format!("no command came within {s} s; the connection ends")), now);
            self.has_ended = true;
        } else {
            self.is_broken = true;
        }
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
            self.read();
        }
        self.write(now);
    }

    fn is_free(&self) -> bool {
        self.rest.is_empty() && self.order.is_none()
    }

    /// Once: what is left comes with the next call, after the others' turn.
    fn read(&mut self) {
        let mut bytes = [0; CONTROL_LINE_BYTES_MAX];
        let room = self.lines.room();
        match self.socket.read(&mut bytes[..room]) {
            Ok(0) => self.has_ended = room > 0,
            Ok(count) => {
                self.lines.put(&bytes[..count]);
            }
            Err(error) => self.note(&error),
        }
    }

    /// The next command, as soon as the one before is answered and the answer taken. A line that is none is the last.
    pub(super) fn next_command(&mut self) -> Option<Result<ControlCommand, ControlError>> {
        let command = if self.is_free() && !self.is_broken { self.lines.next_command() } else { None };
        self.has_ended |= matches!(command, Some(Err(_)));
        command
    }

    pub(super) fn answer(&mut self, answer: &ControlAnswer, now: Instant) {
        (self.order, self.since) = (None, now);
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
                    // The next command may take its time from now on.
                    self.since = if self.rest.is_empty() { now } else { self.since };
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    const STEP: Duration = Duration::from_secs(1);

    /// A connection that began at this time, and its other end.
    fn connected(now: Instant) -> (ControlClient, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let other = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        other.set_read_timeout(Some(10 * STEP)).unwrap();
        (ControlClient::new(listener.accept().unwrap().0, now).unwrap(), other)
    }

    /// The runtime has nothing to wait for.
    fn is_over(client: &ControlClient) -> bool {
        client.is_broken || client.has_ended && client.is_free()
    }

    /// The other end says this, and it comes.
    fn says(client: &mut ControlClient, other: &mut TcpStream, bytes: &[u8], now: Instant) {
        other.write_all(bytes).unwrap();
        let before = client.lines.room();
        while client.lines.room() == before {
            client.move_bytes(now);
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_connection_that_is_silent_or_slow_ends_and_is_told_why() {
        for drips in [false, true] {
            let began = Instant::now();
            let (mut client, mut other) = connected(began);
            // A command in time, and then none.
            let begin = began + WITHIN - STEP;
            says(&mut client, &mut other, b"status\n", begin);
            client.look(begin);
            assert_eq!(client.next_command(), Some(Ok(ControlCommand::Status)));
            client.answer(&ControlAnswer::ok(), begin);
            let mut now = begin;
            while now < begin + WITHIN {
                client.look(now);
                assert!(!is_over(&client) && client.next_command().is_none(), "not so soon");
                if drips {
                    says(&mut client, &mut other, b"x", now);
                }
                now += STEP;
            }
            client.look(now);
            assert!(is_over(&client));
            drop(client);
            let mut said = String::new();
            other.read_to_string(&mut said).unwrap();
            assert_eq!(said, "OK\nERR no command came within 30 s; the connection ends\n");
        }
    }

    #[test]
    fn a_connection_that_takes_no_answer_ends_and_one_with_an_order_under_way_does_not() {
        let began = Instant::now();
        let (mut client, _other) = connected(began);
        let answer = ControlAnswer::ok().with_text("text", &"x".repeat(100_000));
        while client.rest.is_empty() {
            client.answer(&answer, began);
        }
        client.look(began + WITHIN - STEP);
        assert!(!is_over(&client), "not so soon");
        client.look(began + WITHIN);
        assert!(is_over(&client));

        let (mut client, _other) = connected(began);
        client.wait_for(1);
        client.look(began + 100 * WITHIN);
        assert!(!is_over(&client), "the disk is slow");
    }

    #[test]
    fn behind_a_line_that_is_no_command_the_connection_ends() {
        let now = Instant::now();
        let (mut client, mut other) = connected(now);
        says(&mut client, &mut other, b"EHLO robot\r\noff\n", now);
        let error = client.next_command().unwrap().unwrap_err();
        client.answer(&ControlAnswer::err(&error), now);
        assert!(is_over(&client) && client.next_command().is_none());
    }
}
