//! Stands for the viewer: Rerun's client connects to a local socket, and the proxy connects to the viewer.
//!
//! ```text
//!   Rerun's gRPC client ──▶ 127.0.0.1:some port ──▶ [ViewerProxy] ──▶ viewer
//! ```
//!
//! Rerun's client never gives up: without a viewer it tries for ever, and with one that stands still it waits for as
//! long as it lives, and so does its caller. It has no way to be stopped. A proxy has one: when it is cut, all that
//! Rerun waits for fails at once, its threads end, and its memory is free. It also tells whether the viewer has
//! answered: the kernel connects to one that stands still, too.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Bytes handed over at once.
const BUFFER_BYTES: usize = 64 * 1024;
/// How often a thread that waits for Rerun's client looks whether it is still wanted.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

struct ProxyState {
    viewer: TcpStream,
    client: OnceLock<TcpStream>,
    answered: AtomicBool,
    broken: AtomicBool,
}

/// A connection to a viewer that can be cut.
pub(crate) struct ViewerProxy {
    shared: Arc<ProxyState>,
    port: u16,
}

impl ViewerProxy {
    /// Connects to a viewer, at one of its addresses.
    pub(crate) fn open(host: &str, port: u16, patience: Duration) -> io::Result<Self> {
        let mut failure = io::Error::new(io::ErrorKind::NotFound, "its name has no address");
        for address in (host, port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, patience) {
                Ok(viewer) if is_itself(&viewer) => failure = io::ErrorKind::ConnectionRefused.into(),
                Ok(viewer) => return Self::over(viewer),
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }

    fn over(viewer: TcpStream) -> io::Result<Self> {
        viewer.set_nodelay(true)?;
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let port = listener.local_addr()?.port();
        listener.set_nonblocking(true)?;
        let (answered, broken) = (AtomicBool::new(false), AtomicBool::new(false));
        let shared = Arc::new(ProxyState { viewer, client: OnceLock::new(), answered, broken });
        let outward = shared.clone();
        std::thread::Builder::new().name("to viewer".into()).spawn(move || outward.run(&listener))?;
        Ok(Self { shared, port })
    }

    /// Where Rerun finds it.
    pub(crate) fn url(&self) -> String {
        format!("rerun+http://127.0.0.1:{}/proxy", self.port)
    }

    /// Whether the viewer has said anything.
    pub(crate) fn has_answered(&self) -> bool {
        self.shared.answered.load(Ordering::Relaxed)
    }

    /// Whether one of the two ends has gone.
    pub(crate) fn is_broken(&self) -> bool {
        self.shared.broken.load(Ordering::Relaxed)
    }

    /// Ends it: both ends are told.
    pub(crate) fn cut(&self) {
        self.shared.cut();
    }
}

/// A connection to an unused local port in the range of source ports sometimes connects a socket to itself. It would
/// occupy the viewer's port, and read its own bytes as an answer.
fn is_itself(viewer: &TcpStream) -> bool {
    matches!((viewer.local_addr(), viewer.peer_addr()), (Ok(here), Ok(there)) if here == there)
}

impl Drop for ViewerProxy {
    fn drop(&mut self) {
        self.cut();
    }
}

impl ProxyState {
    fn cut(&self) {
        self.broken.store(true, Ordering::Relaxed);
        // What is closed already cannot be closed; that is as good.
        let _ = self.viewer.shutdown(Shutdown::Both);
        if let Some(client) = self.client.get() {
            let _ = client.shutdown(Shutdown::Both);
        }
    }

    /// Waits for Rerun's client, then passes on what it sends; another thread passes on the answers.
    fn run(self: Arc<Self>, listener: &TcpListener) {
        let client = loop {
            match listener.accept() {
                Ok((client, _)) => break client,
                Err(_) if self.broken.load(Ordering::Relaxed) => return,
                Err(_) => std::thread::sleep(POLL_INTERVAL),
            }
        };
        // A socket inherits that its listener does not block on some systems.
        let made = client.set_nonblocking(false).and_then(|()| client.set_nodelay(true));
        let client = self.client.get_or_init(|| client);
        let back = self.clone();
        let answers = std::thread::Builder::new().name("from viewer".into()).spawn(move || back.answer());
        if made.is_ok() && answers.is_ok() && !self.broken.load(Ordering::Relaxed) {
            self.pass_on(client);
        }
        self.cut();
    }

    fn pass_on(&self, mut client: &TcpStream) {
        let mut buffer = vec![0; BUFFER_BYTES];
        while let Ok(bytes @ 1..) = client.read(&mut buffer) {
            if (&self.viewer).write_all(&buffer[..bytes]).is_err() {
                break;
            }
        }
    }

    fn answer(&self) {
        let mut buffer = vec![0; BUFFER_BYTES];
        let Some(mut client) = self.client.get() else { return };
        while let Ok(bytes @ 1..) = (&self.viewer).read(&mut buffer) {
            self.answered.store(true, Ordering::Relaxed);
            if client.write_all(&buffer[..bytes]).is_err() {
                break;
            }
        }
        self.cut();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_secs(10);

    #[test]
    fn a_socket_connected_to_itself_has_no_viewer() {
        let range = std::fs::read_to_string("/proc/sys/net/ipv4/ip_local_port_range").unwrap();
        let ports: Vec<u16> = range.split_whitespace().map(|port| port.parse().unwrap()).collect();
        // Linux picks the source port from every second of these, so at some time it picks the port that is connected
        // to.
        let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap().port();
        let port = free - (free - ports[0]) % 2;
        let tries = 4 * u32::from(ports[1] - ports[0]);
        let itself = (0..tries).find_map(|_| TcpStream::connect_timeout(&([127, 0, 0, 1], port).into(), PATIENCE).ok());
        let itself = itself.filter(|socket| socket.local_addr().unwrap().port() == port);
        let Some(itself) = itself else {
            let why = format!("a socket connected to itself; in {tries} attempts this system made none");
            return rohrpost_test_report::skipped(&why);
        };
        assert!(is_itself(&itself));
        drop(itself);
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let proxy = ViewerProxy::open("127.0.0.1", listener.local_addr().unwrap().port(), PATIENCE).unwrap();
        assert!(!is_itself(&proxy.shared.viewer));
    }
}
