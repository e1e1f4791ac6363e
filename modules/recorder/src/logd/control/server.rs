//! Log control by TCP: connections that the runtime watches. A slow or silent one holds nobody up, and ends.

use super::client::{ControlClient, WITHIN};
use rohrpost::{Context, Interest, Ready, Watch};
use rohrpost_recording::{ControlAnswer, ControlCommand, ControlError};
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// Connections at a time.
const CLIENTS_MAX: usize = 8;
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

    /// Has the runtime wait for what is next; connections that are over, or took too long, are forgotten.
    pub(in crate::logd) fn watch(&mut self, context: &mut Context, now: Instant) {
        self.clients.retain_mut(|client| {
            client.look(now);
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
            Ok((socket, _)) => self.take_in(socket, now),
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

    fn take_in(&mut self, socket: TcpStream, now: Instant) {
        if self.clients.len() >= CLIENTS_MAX {
            return refuse(socket);
        }
        // One that has no descriptor is gone at once.
        self.clients.extend(ControlClient::new(socket, now));
    }
}

/// Says why, if that goes without waiting.
fn refuse(mut socket: TcpStream) {
    let s = WITHIN.as_secs();
    let why = format!("{CLIENTS_MAX} connections are open already; close one, or try again in {s} s");
    let why = ControlAnswer::err(&why);
    if socket.set_nonblocking(true).is_ok() {
        let _ = socket.write_all(format!("{}\n", why.line()).as_bytes());
    }
}
