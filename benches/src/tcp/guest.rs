//! One session of a crowd: the client that nodes have, with a socket of its own.

use super::systems::{guest, system_of};
use super::tally::Tally;
use nix::sys::epoll::{Epoll, EpollEvent, EpollFlags};
use rohrpost_bench_local::harness::{End, Failure, OrFail};
use rohrpost_mailbox::{Head, Name, Options, Priority, Type, monotonic_ns};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::report::NotDelivered;
use rohrpost_routers::session::client::{Client, ClientEvent, ClientHost, ClientPackage, ClientSettings, ClientStep};
use rohrpost_routers::session::frame::{Carried, Range};
use rohrpost_routers::session::{Cause, EndHost};
use rohrpost_routers::tcp::{ClientSeal, Moved, Stream};
use std::net::SocketAddr;

/// Bytes at the head of each body: its number, and when it was due. All other bytes follow from the number.
const STAMPS_BYTES: usize = 16;
const QUOTA_BYTES: usize = 1 << 20;
/// The class is no bulk class.
const LEVELS: [u8; 256] = [0; 256];

/// What all guests have in common.
pub(super) struct House<'a> {
    pub(super) address: SocketAddr,
    pub(super) common: u64,
    pub(super) seal: Option<ClientSeal>,
    pub(super) epoll: Epoll,
    pub(super) tally: &'a Tally,
    /// What was due in this time counts, ns.
    pub(super) counted_ns: (u64, u64),
    /// Of packages that count, each so many-th is a sample.
    pub(super) sampled_each: u64,
}

/// A session.
pub(super) struct Guest {
    index: u16,
    client: Client,
    stream: Option<Stream>,
    /// The connection is not made yet.
    is_begun: bool,
    awaits_room: bool,
    next_number: u64,
    /// Number of the next package that may arrive: each guest receives from one other.
    expected: u64,
}

impl Guest {
    pub(super) fn new(index: u16, common: u64, now_ns: u64) -> Self {
        let settings = ClientSettings {
            name: format!("guest {index}"),
            system: system_of(End::Pong),
            reaches_own: false,
            common,
            system_digest: 1,
            incarnation: u64::from(index) + 1,
            quota_bytes: QUOTA_BYTES,
            levels: LEVELS,
            admission: Admission::default(),
        };
        let own = guest(index);
        let client = Client::new(settings, vec![Range { first: own, last: own }], now_ns);
        Self { index, client, stream: None, is_begun: false, awaits_room: false, next_number: 0, expected: 0 }
    }

    /// Sends a package that was due then.
    pub(super) fn send(&mut self, house: &House<'_>, to: Name, body: &mut [u8], due_ns: u64) -> Result<(), Failure> {
        let now_ns = monotonic_ns();
        fill(body, self.next_number, due_ns);
        self.next_number += 1;
        let head = Head {
            to,
            from: guest(self.index),
            len: body.len() as u16,
            kind: Type::data(0),
            id: 0,
            priority: Priority(to.class().0),
            options: Options::default(),
        };
        if house.counts(due_ns) {
            house.tally.sent.add(1);
        }
        let mut inbox = Inbox { house, expected: &mut self.expected, wrong: None };
        self.client.send(now_ns, &ClientPackage { head, body, published_ns: now_ns, hops: 0 }, &mut inbox);
        self.act(house, now_ns)
    }

    /// Its connection, for which no events are reported any more.
    pub(super) fn into_stream(self, house: &House<'_>) -> Option<Stream> {
        let stream = self.stream?;
        house.epoll.delete(&stream).is_ok().then_some(stream)
    }

    /// Handles an event of its socket.
    pub(super) fn happened(&mut self, house: &House<'_>, flags: EpollFlags, piece: &mut [u8]) -> Result<(), Failure> {
        let now_ns = monotonic_ns();
        let Some(stream) = &mut self.stream else { return Ok(()) };
        if self.is_begun && flags.contains(EpollFlags::EPOLLOUT) {
            stream.connected().or_fail("connect")?;
            self.is_begun = false;
            self.client.connected(now_ns);
        } else if flags.contains(EpollFlags::EPOLLOUT) {
            stream.flush().or_fail("write")?;
            if !stream.has_unsent() {
                self.await_room(house, false)?;
                self.client.writable();
            }
        }
        if !self.is_begun && flags.intersects(EpollFlags::EPOLLIN | EpollFlags::EPOLLHUP) {
            self.read(house, piece)?;
        }
        self.act(house, now_ns)
    }

    /// Does its periodic work.
    pub(super) fn act(&mut self, house: &House<'_>, now_ns: u64) -> Result<(), Failure> {
        loop {
            let mut inbox = Inbox { house, expected: &mut self.expected, wrong: None };
            match self.client.poll(now_ns, &mut inbox) {
                ClientStep::Wait { .. } => return inbox.wrong.map_or(Ok(()), Err),
                ClientStep::Connect => self.connect(house)?,
                ClientStep::Write => self.write(house)?,
                ClientStep::Close => return Err(Failure::Failed(format!("guest {} lost its connection", self.index))),
            }
        }
    }

    fn connect(&mut self, house: &House<'_>) -> Result<(), Failure> {
        let sealed = house.seal.as_ref().map(ClientSeal::begin).transpose();
        let stream = sealed.and_then(|sealed| Stream::connect(house.address, sealed)).or_fail("connect")?;
        let event = EpollEvent::new(EpollFlags::EPOLLIN | EpollFlags::EPOLLOUT, self.index.into());
        house.epoll.add(&stream, event).or_fail("epoll")?;
        (self.stream, self.is_begun, self.awaits_room) = (Some(stream), true, true);
        Ok(())
    }

    fn read(&mut self, house: &House<'_>, piece: &mut [u8]) -> Result<(), Failure> {
        let Some(stream) = &mut self.stream else { return Ok(()) };
        match stream.read(piece) {
            Moved::Nothing => stream.flush().or_fail("write"),
            Moved::Over(error) => {
                let why = error.map_or_else(String::new, |error| error.to_string());
                Err(Failure::Failed(format!("guest {}: the TCP router closed the connection: {why}", self.index)))
            }
            Moved::Bytes(bytes) => {
                let mut inbox = Inbox { house, expected: &mut self.expected, wrong: None };
                let was_up = self.client.is_up();
                self.client.received(monotonic_ns(), &piece[..bytes], &mut inbox);
                if self.client.is_up() && !was_up {
                    house.tally.up.add(1);
                }
                inbox.wrong.map_or(Ok(()), Err)
            }
        }
    }

    fn write(&mut self, house: &House<'_>) -> Result<(), Failure> {
        let Some(stream) = &mut self.stream else { return Ok(()) };
        let ready = self.client.ready();
        let (moved, wanted) = (stream.write(ready, self.client.has_waiting()), ready.len());
        let is_all = matches!(moved, Moved::Bytes(bytes) if bytes == wanted) && !stream.has_unsent();
        match moved {
            Moved::Bytes(bytes) => self.client.took(monotonic_ns(), bytes),
            Moved::Nothing => self.client.took(monotonic_ns(), 0),
            Moved::Over(error) => return Err(Failure::of("write", error.map_or_else(String::new, |e| e.to_string()))),
        }
        // During the handshake it waits for room anyway.
        self.await_room(house, !is_all)
    }

    fn await_room(&mut self, house: &House<'_>, awaits: bool) -> Result<(), Failure> {
        let Some(stream) = self.stream.as_ref().filter(|_| self.awaits_room != awaits) else { return Ok(()) };
        self.awaits_room = awaits;
        let room = if awaits { EpollFlags::EPOLLOUT } else { EpollFlags::empty() };
        let mut event = EpollEvent::new(EpollFlags::EPOLLIN | room, self.index.into());
        house.epoll.modify(stream, &mut event).or_fail("epoll")
    }
}

impl House<'_> {
    fn counts(&self, due_ns: u64) -> bool {
        self.counted_ns.0 <= due_ns && due_ns < self.counted_ns.1
    }
}

/// Receives packages of one guest.
struct Inbox<'a> {
    house: &'a House<'a>,
    expected: &'a mut u64,
    wrong: Option<Failure>,
}

impl EndHost for Inbox<'_> {
    fn answer(&mut self, _: &[u8], _: Cause, _: Option<&str>, _: &mut Vec<u8>) -> bool {
        false
    }
}

impl ClientHost for Inbox<'_> {
    fn deliver(&mut self, carried: &Carried<'_>) -> Result<(), NotDelivered> {
        let (now_ns, house) = (monotonic_ns(), self.house);
        match read(carried.body, *self.expected) {
            Err(wrong) => self.wrong = Some(wrong),
            Ok((number, due_ns)) => {
                *self.expected = number + 1;
                if house.counts(now_ns) {
                    house.tally.meanwhile.add(1);
                }
                if house.counts(due_ns) {
                    house.tally.came.add(1);
                    if house.tally.came.get().is_multiple_of(house.sampled_each) {
                        house.tally.latencies.push(now_ns.saturating_sub(due_ns) as f64 / 1000.0);
                    }
                }
            }
        }
        Ok(())
    }

    fn event(&mut self, event: ClientEvent<'_>) {
        match event {
            ClientEvent::Up => {}
            ClientEvent::Refused(refusal) => self.wrong = Some(Failure::of("refused", refusal)),
            other => self.wrong = Some(Failure::Failed(format!("{other:?}"))),
        }
    }
}

/// Fills a body.
fn fill(body: &mut [u8], number: u64, due_ns: u64) {
    body[..8].copy_from_slice(&number.to_le_bytes());
    body[8..STAMPS_BYTES].copy_from_slice(&due_ns.to_le_bytes());
    body[STAMPS_BYTES..].fill(number as u8);
}

/// Number and due time of a body. Earlier ones may be lost, but none is duplicated or reordered.
fn read(body: &[u8], expected: u64) -> Result<(u64, u64), Failure> {
    let Some((stamps, rest)) = body.split_first_chunk::<STAMPS_BYTES>() else {
        return Err(Failure::Failed(format!("a package of {} bytes came", body.len())));
    };
    let [number, due_ns] = [0, 8].map(|at| {
        let mut long = [0; 8];
        long.copy_from_slice(&stamps[at..at + 8]);
        u64::from_le_bytes(long)
    });
    if number < expected {
        return Err(Failure::Failed(format!("package {number} came when {expected} was due")));
    }
    match rest.iter().find(|byte| **byte != number as u8) {
        Some(wrong) => Err(Failure::Failed(format!("damaged: a byte is {wrong}, not {}", number as u8))),
        None => Ok((number, due_ns)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_happens_to_a_package_is_seen() {
        let mut body = [0; 64];
        fill(&mut body, 7, 1234);
        assert_eq!(read(&body, 7), Ok((7, 1234)));
        assert_eq!(read(&body, 3), Ok((7, 1234)), "some may be lost");
        assert!(read(&body, 8).is_err(), "twice");
        assert!(read(&body[..9], 7).is_err(), "cut");
        body[40] ^= 1;
        assert!(read(&body, 7).is_err(), "damaged");
    }
}
