//! Log control by TCP: connections that the runtime watches. A slow or silent one holds nobody up.

use super::client::ControlClient;
use rohrpost::{Context, Interest, Ready, Watch};
use rohrpost_recording::{ControlAnswer, ControlCommand, ControlError};
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// Connections at a time.
const CLIENTS_MAX: usize = 8;
/// When all are taken, a new one replaces the one that was silent the longest, if that is so long.
const SILENT: Duration = Duration::from_secs(60);
/// A socket that cannot be had is tried again after so long.
const RETRY: Duration = Duration::from_secs(5);

/// The socket that listens, and its connections.
pub(in crate::logd) struct ControlServer {
    /// None: by the interface alone.
    address: Option<SocketAddr>,
    listener: Option<TcpListener>,
    watch: Option<Watch>,
    retry_at: Option<Instant>,
    /// It was told that the socket cannot be had.
    has_complained: bool,
    clients: Vec<ControlClient>,
}

impl ControlServer {
    pub(in crate::logd) fn new(address: Option<SocketAddr>) -> Self {
        Self { address, listener: None, watch: None, retry_at: None, has_complained: false, clients: Vec::new() }
    }

    /// Listens, if it does not yet.
    pub(in crate::logd) fn open(&mut self, context: &mut Context, now: Instant) {
        let Some(address) = self.address else { return };
        if self.watch.is_some() || self.retry_at.is_some_and(|at| now < at) {
            return;
        }
        match self.listen(address, context) {
            Ok(watch) => {
                (self.watch, self.retry_at) = (Some(watch), None);
                self.has_complained = false;
            }
            Err(error) => self.complain(&error, now),
        }
    }

    fn listen(&mut self, address: SocketAddr, context: &mut Context) -> io::Result<Watch> {
        let listener = match self.listener.take() {
            Some(listener) => listener,
            None => TcpListener::bind(address)?,
        };
        listener.set_nonblocking(true)?;
        context.watch(self.listener.insert(listener), Interest::Read)
    }

    /// Recording does not depend on it.
    fn complain(&mut self, error: &io::Error, now: Instant) {
        self.retry_at = Some(now + RETRY);
        if let Some(address) = self.address
            && !self.has_complained
        {
            tracing::error!(
                errno = error.raw_os_error(),
                "log control: cannot listen at {address}: {error}; tries again, and records all the same"
            );
            self.has_complained = true;
        }
    }

    /// Ends all connections, and listens no more.
    pub(in crate::logd) fn close(&mut self, context: &mut Context) {
        self.clients.drain(..).for_each(|mut client| client.forget(context));
        if let Some(watch) = self.watch.take() {
            context.unwatch(watch);
        }
        (self.listener, self.retry_at) = (None, None);
    }

    /// Takes in what a descriptor brings.
    pub(in crate::logd) fn ready(&mut self, context: &mut Context, ready: Ready, now: Instant) {
        if self.watch == Some(ready.watch) {
            self.accept(context, now);
        } else if let Some(client) = self.clients.iter_mut().find(|client| client.is_watched_by(ready.watch)) {
            client.move_bytes(now);
        }
    }

    /// The next command, and the connection that it is from.
    pub(in crate::logd) fn next_command(&mut self) -> Option<(usize, Result<ControlCommand, ControlError>)> {
        let mut all = self.clients.iter_mut().enumerate();
        all.find_map(|(at, client)| Some((at, client.next_command()?)))
    }

    /// The connection waits for the answer to this order.
    pub(in crate::logd) fn wait_for(&mut self, client: usize, order: u32) {
        self.clients[client].wait_for(order);
    }

    /// Answers the connection at once.
    pub(in crate::logd) fn answer(&mut self, client: usize, answer: &ControlAnswer, now: Instant) {
        self.clients[client].answer(answer, now);
    }

    /// Tells answers that are there by now.
    pub(in crate::logd) fn tell(&mut self, mut take: impl FnMut(u32) -> Option<ControlAnswer>, now: Instant) {
        for client in &mut self.clients {
            if let Some(answer) = client.order().and_then(&mut take) {
                client.answer(&answer, now);
            }
        }
    }

    /// Has the runtime wait for what is next; connections that are over are forgotten.
    pub(in crate::logd) fn watch(&mut self, context: &mut Context) {
        self.clients.retain_mut(|client| {
            let lives = client.watch(context);
            if !lives {
                client.forget(context);
            }
            lives
        });
    }

    /// One connection: the next comes with the next call.
    fn accept(&mut self, context: &mut Context, now: Instant) {
        let Some(listener) = &self.listener else { return };
        match listener.accept() {
            Ok((socket, _)) => self.take_in(socket, context, now),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(error) => {
                // It stays ready meanwhile, and must not keep the module busy.
                if let Some(watch) = self.watch.take() {
                    context.unwatch(watch);
                }
                self.complain(&error, now);
            }
        }
    }

    fn take_in(&mut self, socket: TcpStream, context: &mut Context, now: Instant) {
        if self.clients.len() >= CLIENTS_MAX {
            match replaceable(&self.clients, now) {
                Some(at) => self.clients.remove(at).forget(context),
                None => return refuse(socket),
            }
        }
        // One that has no descriptor is gone at once.
        self.clients.extend(ControlClient::new(socket, now));
    }
}

/// The connection that makes room for another one.
fn replaceable(clients: &[ControlClient], now: Instant) -> Option<usize> {
    let silent = clients.iter().map(|client| client.silent(now)).enumerate();
    silent.filter(|(_, silent)| *silent >= SILENT).max_by_key(|(_, silent)| *silent).map(|(at, _)| at)
}

/// Says why, if that goes without waiting.
fn refuse(mut socket: TcpStream) {
    let why = ControlAnswer::err(&format!("{CLIENTS_MAX} connections are open already; close one"));
    if socket.set_nonblocking(true).is_ok() {
        let _ = socket.write_all(format!("{}\n", why.line()).as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    /// Connections that all are there, and their other ends.
    fn connected(now: Instant) -> (Vec<ControlClient>, Vec<TcpStream>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let pair = |_| {
            let other = TcpStream::connect(address).unwrap();
            (ControlClient::new(listener.accept().unwrap().0, now).unwrap(), other)
        };
        (0..CLIENTS_MAX).map(pair).unzip()
    }

    /// Nothing is heard of an order that takes long, either.
    #[test]
    fn connections_that_take_no_answers_make_room_and_those_that_wait_for_one_do_not() {
        let began = Instant::now();
        let (mut clients, mut others) = connected(began);
        let answer = ControlAnswer::ok().with_text("text", &"x".repeat(100_000));
        for client in &mut clients {
            while !client.has_rest() {
                client.answer(&answer, began);
            }
        }
        assert_eq!(replaceable(&clients, began + SILENT / 2), None, "not so soon");
        let later = began + SILENT;
        assert!(replaceable(&clients, later).is_some());
        // One of them goes on reading, however slowly.
        let mut taken = vec![0; 10_000_000];
        while clients[0].silent(later) > Duration::ZERO {
            assert!(others[0].read(&mut taken).unwrap() > 0);
            clients[0].move_bytes(later);
        }
        clients[1..].iter_mut().for_each(|client| client.wait_for(1));
        assert_eq!(replaceable(&clients, later), None);
    }
}
