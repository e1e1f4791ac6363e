//! The least cost of a hop over two routers: from module to relay, by UDP to the other relay, from there to the module.
//!
//! ```text
//!  ping ──▶ relay ══UDP══▶ relay ──▶ pong
//!  ping ◀── relay ◀══UDP══ relay ◀── pong
//! ```
//! Each relay is a process and carries one direction, so that none ever waits for two things at once. No relay inspects
//! messages. [`time_chain`] hands over by one slot and a futex, [`time_mailbox_chain`] by mailboxes: what a router
//! costs beyond that is its own.

use super::Wire;
use super::udp::Datagrams;
use rohrpost_bench_local::hand_over::{HandOver, Lanes, Wake};
use rohrpost_bench_local::harness::{
    Cell, Child, End, Failure, Gate, Link, Meetings, Scratch, Shared, check_children, settle, time_two_processes,
};
use rohrpost_bench_local::ours::Station;
use rohrpost_mailbox::Name;

/// From the near end to the far one, and back.
const PORTS: [u16; 2] = [20_118, 20_119];

/// Mailboxes of a node of the chain.
const MODULE: Name = Name::new(1, 1, 0, 0);
const RELAY: Name = Name::new(1, 2, 0, 0);

/// Times the chain of futexes; see [`time_two_processes`].
///
/// # Errors
/// What a relay failed with, else an end.
pub fn time_chain(wire: &Wire, cell: &Cell) -> Result<Vec<f64>, Failure> {
    let nodes = [Shared::<Lanes>::new()?, Shared::<Lanes>::new()?];
    // On its node the module is the near side of the lanes, both relays together are the far one.
    let side = |end: End, side| Ok(HandOver::new(&nodes[end.index()], side, Wake::Futex));
    time(wire, cell, |end, _| side(end, End::Pong), |end, _| side(end, End::Ping))
}

/// Times the chain of mailboxes.
///
/// # Errors
/// As [`time_chain`].
pub fn time_mailbox_chain(wire: &Wire, cell: &Cell) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let station = |end: End, own, other| Station::open(&scratch.directory().join(end.node()), own, other, cell.bytes);
    let relay = |end, goes| match goes {
        Goes::Out => station(end, Some(RELAY), MODULE),
        Goes::In => station(end, None, MODULE),
    };
    time(wire, cell, relay, |end, _| station(end, Some(MODULE), RELAY))
}

/// What a relay does on its node.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Goes {
    /// Carries from the module to the network.
    Out,
    /// Carries from the network to the module.
    In,
}

fn time<R: Link, M: Link>(
    wire: &Wire,
    cell: &Cell,
    relay: impl Fn(End, Goes) -> Result<R, Failure>,
    module: impl Fn(End, &mut Meetings) -> Result<M, Failure>,
) -> Result<Vec<f64>, Failure> {
    let gate = Shared::<Gate>::new()?;
    let start = |(end, goes)| {
        Child::start(|| {
            // A port for each direction: an end that only sends must not receive.
            let there = (goes == Goes::Out) == (end == End::Ping);
            let port = PORTS[usize::from(!there)];
            let mut network = Datagrams::between(wire, end, [port, port])?;
            let mut local = relay(end, goes)?;
            settle(end, cell.placement, cell.scheduling)?;
            gate.meet(ALL)?;
            match goes {
                Goes::Out => carry(&mut local, &mut network, cell.bytes),
                Goes::In => carry(&mut network, &mut local, cell.bytes),
            }
        })
    };
    let all = [(End::Ping, Goes::Out), (End::Ping, Goes::In), (End::Pong, Goes::Out), (End::Pong, Goes::In)];
    let mut relays = all.into_iter().map(start).collect::<Result<Vec<_>, Failure>>()?;
    gate.meet_children(&mut relays)?;
    let timed = time_two_processes(cell, module);
    check_children(&mut relays)?;
    timed
}

/// The relays, and the process that starts them.
const ALL: u32 = 5;

fn carry(from: &mut impl Link, to: &mut impl Link, bytes: usize) -> Result<(), Failure> {
    let mut message = vec![0; bytes];
    loop {
        from.receive(&mut message)?;
        to.send(&message)?;
    }
}
