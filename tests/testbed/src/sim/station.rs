//! One computer of a simulated network: clocks, modules, and the layers that its router is made of.
//!
//! A [`Layer`] is one protocol with one socket, packages or time, or all that one thread does with both. It sees what a
//! real one sees: its own clocks, the datagrams of its sockets, the mailboxes of its computer. When its router dies,
//! all layers are dropped, and made anew.

use super::chance::Chance;
use super::clock::{Clock, Now};
use super::host::{Host, Parcel};
use super::oracle::Oracle;
use super::package::Role;
use super::plan::Plan;
use super::trace::Trace;
use std::collections::VecDeque;
use std::net::{IpAddr, Ipv4Addr};
use std::rc::Rc;

/// A socket of a router, by its place behind the configured port.
pub(crate) type Port = usize;
/// An address that no node has.
pub(crate) const STRANGER: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 77, 255, 254));
/// Sockets of a router.
pub(crate) const PORTS: usize = 3;
/// A thread that is busy works for less at a time.
const STILL_NS: u64 = 2 * super::spans::MS;
/// Bytes that a socket holds for a router that does not read.
pub(crate) const SOCKET_BYTES_MAX: usize = 256 * 1024;

/// What a layer may do and see while it runs.
pub(crate) struct Io<'a> {
    pub(crate) now: Now,
    /// Which says what they show later.
    pub(crate) clock: &'a Clock,
    /// When it began what it does, true ns.
    pub(crate) began_ns: u64,
    pub(crate) node: usize,
    pub(crate) plan: &'a Plan,
    /// Counts the router's lives, over all nodes.
    pub(crate) life: u32,
    /// The incarnation of each node's router; 0: none.
    pub(crate) lives: &'a [u32],
    pub(crate) host: &'a mut Host,
    pub(crate) oracle: &'a mut Oracle,
    pub(crate) chance: &'a mut Chance,
    pub(crate) sent: &'a mut Vec<Sent>,
    pub(crate) trace: &'a mut Trace,
}

impl Io<'_> {
    /// Whether a package is one of a program that writes what it likes in its heads.
    pub(super) fn is_intruders(&self, parcel: &Parcel) -> bool {
        self.oracle.packages[parcel.number as usize].role == Role::Intruder
    }

    /// The thread was busy for so long: what it does next is later.
    pub(crate) fn works(&mut self, for_ns: u64) {
        if for_ns > 0 {
            self.now = self.clock.at(self.now.true_ns + for_ns);
        }
    }

    /// Whether it stood still meanwhile: what it does after that happens only if its router lives so long.
    pub(crate) fn stood_still(&self) -> bool {
        self.now.true_ns > self.began_ns + STILL_NS
    }

    pub(crate) fn line(&mut self, text: impl FnOnce() -> String) {
        let (node, life) = (self.node, self.life);
        self.trace.line(self.now.true_ns, || format!("{node}/{life} {}", text()));
    }
}

/// A datagram on its way out.
pub(crate) struct Sent {
    pub(crate) port: Port,
    pub(crate) to: usize,
    pub(crate) bytes: Rc<[u8]>,
    /// When it was handed over; [`Now::default`] for what leaves at once.
    pub(crate) handed: Now,
    /// Incarnation of the receiver that it is sealed to, where it is sealed to one.
    pub(crate) sealed_to: Option<u64>,
}

/// Where a datagram that comes in is from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Origin {
    /// A router sent it to this node, and it is as it was; the wire may have doubled it, or somebody repeated it.
    Sent {
        /// See [`Sent::sealed_to`].
        sealed_to: Option<u64>,
    },
    /// The same, but bits of it were flipped on the way.
    Damaged,
    /// Somebody made it, altered it or brought it to another node.
    Made,
}

/// A datagram that came in.
#[derive(Clone, Debug)]
pub(crate) struct Arrived {
    /// Socket that has it.
    pub(crate) port: Port,
    /// Node that has the address it comes from; none: an address that no node has.
    pub(crate) source: Option<usize>,
    pub(crate) bytes: Rc<[u8]>,
    /// When the kernel had it.
    pub(crate) stamp: Now,
    /// Where it is from.
    pub(crate) origin: Origin,
}

/// A protocol of a router.
pub(crate) trait Layer {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived);
    /// The kernel says when a datagram left a socket: which one, counted from 0, and on which clocks.
    fn left(&mut self, io: &mut Io<'_>, port: Port, index: u64, stamp: Now);
    /// Does what is due; when to be called again, on its monotonic clock.
    fn poll(&mut self, io: &mut Io<'_>) -> u64;
    /// Its router dies now: only the books may be looked at.
    fn dies(&mut self, io: &mut Io<'_>);
    /// What must hold at any time; called often, with `well` if all should be well by now.
    fn check(&mut self, io: &mut Io<'_>, well: bool);
    /// What must hold at the end, when all has come to rest.
    fn close(&mut self, io: &mut Io<'_>);
}

/// A router that lives.
pub(crate) struct Router {
    /// Which incarnation this is, over all nodes.
    pub(crate) life: u32,
    /// Its protocols: one for each socket, or one for all.
    pub(crate) layers: Vec<Box<dyn Layer>>,
    /// Datagrams that left each socket.
    pub(crate) sent: [u64; PORTS],
}

impl Router {
    pub(crate) fn layer(&mut self, port: Port) -> Option<&mut Box<dyn Layer>> {
        let last = self.layers.len().saturating_sub(1);
        self.layers.get_mut(port.min(last))
    }
}

pub(crate) struct Station {
    pub(crate) clock: Clock,
    pub(crate) host: Host,
    /// Its router, while it lives.
    pub(crate) router: Option<Router>,
    /// How much its clocks run faster than planned now, ns a second.
    pub(crate) drift_ppb: i64,
    /// How many faults keep its router dead.
    pub(crate) down: u32,
    /// How many faults keep its router from running.
    pub(crate) frozen: u32,
    /// How many faults keep its modules from running.
    pub(crate) asleep: u32,
    /// How many faults have it sleep.
    pub(crate) sleeps: u32,
    /// Which edition of the configuration its router is started from.
    pub(crate) edition: usize,
    /// So much later comes again what it is told of the time; none: nobody repeats it.
    pub(crate) echo_ns: Option<u64>,
    /// When its timing thread last went to sleep to wake too late, true ns.
    pub(crate) late_at_ns: u64,
    /// What came in while the router did not run, by port.
    pub(crate) sockets: [VecDeque<Arrived>; PORTS],
    /// When it is to be woken, true ns; none: not.
    pub(crate) wake_ns: Option<u64>,
}

impl Station {
    /// One of which the router has not begun yet.
    pub(crate) fn new(clock: Clock) -> Self {
        Self {
            clock,
            host: Host::default(),
            router: None,
            drift_ppb: 0,
            down: 0,
            frozen: 0,
            asleep: 0,
            sleeps: 0,
            edition: 0,
            echo_ns: None,
            late_at_ns: 0,
            sockets: Default::default(),
            wake_ns: None,
        }
    }

    pub(crate) fn runs(&self) -> bool {
        self.router.is_some() && self.frozen == 0
    }

    /// Puts a datagram in a socket that nobody reads now; false: it is full.
    pub(crate) fn keep(&mut self, arrived: Arrived) -> bool {
        let port = arrived.port;
        let waiting: usize = self.sockets[port].iter().map(|other| other.bytes.len() + 256).sum();
        let fits = waiting + arrived.bytes.len() <= SOCKET_BYTES_MAX;
        if fits {
            self.sockets[port].push_back(arrived);
        }
        fits
    }
}
