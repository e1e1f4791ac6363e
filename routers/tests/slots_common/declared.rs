//! Declared flows between nodes in time slots, beside traffic that has no bound: they keep what was computed for them.
//!
//! # How late a package is
//! From its publishing to the moment at which the bridge sees it: that is what bounds are about, and no thread that
//! wakes up is in it. On a computer with much to do the thread of the time slots comes too late now and then, and
//! leaves a slot out, or loses its processor in the middle of one; a bound holds for slots that are kept. The router
//! counts those that are not. So a package that is later than its bound is right only if its router counted one of
//! these in that time, and a processor was seen to stand still then: a router that leaves slots out by itself is wrong.
//! A stall shorter than a millisecond may be over before a thread that watches for stalls wakes up; so the counters
//! alone excuse one package of a hundred. All others keep their bounds.

use super::kept::{assert_inside, told, validate};
use super::{Capture, Crossed, NODES, PATIENCE, Segment, Station, instant, label, module, table};
use rohrpost_config::{Installation, bounds};
use rohrpost_mailbox::{Receiver, Sender, monotonic_ns};
use rohrpost_network::{Tdma, Tunnel};
use rohrpost_routers::flows::Flow;
use rohrpost_routers::tdma::GATE_NS;
use rohrpost_testbed::stalls::{Late, Stalls};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Declared flows: from, to, bytes.
const FLOWS: [(u8, u8, usize); 4] = [(0, 1, 900), (0, 2, 60), (1, 0, 300), (2, 1, 200)];
/// One package in so many may be late since its router left a slot out, without a stall that was seen.
const UNSEEN: usize = 100;
/// No multiple of the cycle: so packages come at all moments of it.
const PERIOD: Duration = Duration::from_millis(23);

/// What a file would say of the segment, and of the flows.
fn installation(tunnel: Option<Tunnel>) -> Installation {
    let mut text = String::from(
        "installation = \"segment\"\n[system]\nname = \"robot\"\nid = 1\n[network]\nsecurity = \"none\"\n\
         mode = \"tdma\"\n\
         [classes]\nrouter = { id = 250, text = \"Carries packages\" }\nit = { id = 100, text = \"Some module\" }\n\
         tool = { id = 16, text = \"Programs run by hand\" }\n[time]\nsource = \"master\"\nmasters = [\"n0\", \"n1\"]\n\
         [tdma]\ncycle = \"10 ms\"\nsynchronisation = \"1 ms\"\nguard = \"400 us\"\nlink = \"1 Gbit/s\"\n",
    );
    if let Some(Tunnel { network, prefix }) = tunnel {
        writeln!(text, "tunnel = \"{network}/{prefix}\"").unwrap();
    }
    for node in 0..NODES {
        let (address, tools, offset) = (node + 1, 16 * node, 3 + 2 * node);
        let calls = FLOWS.iter().filter(|(from, ..)| *from == node).map(|(_, to, _)| format!("\"it.{to}\""));
        let calls = calls.collect::<Vec<_>>().join(", ");
        writeln!(
            text,
            "[nodes.n{node}]\naddress = \"10.77.0.{address}\"\ntools = [{tools}, {}]\n\
             [[slot]]\nnode = \"n{node}\"\noffset = \"{offset} ms\"\nlength = \"1 ms\"\n\
             [[module]]\nname = \"it.{node}\"\nnode = \"n{node}\"\nprogram = \"./it\"\ncalls = [{calls}]",
            tools + 15
        )
        .unwrap();
    }
    for (from, to, bytes) in FLOWS {
        let period = PERIOD.as_millis();
        writeln!(
            text,
            "[[flow]]\nfrom = \"it.{from}\"\nto = \"it.{to}\"\nsize = \"{bytes} B\"\nperiod = \"{period} ms\""
        )
        .unwrap();
    }
    Installation::parse(&text, Path::new("segment.toml")).unwrap_or_else(|errors| panic!("{errors}\n{text}"))
}

/// The bound of each flow.
fn bounds_ns(segment: &Segment) -> Vec<u64> {
    let runs = segment.stations[0].shell().settings();
    let tunnel = runs.tdma.as_ref().unwrap().tunnel;
    let installation = installation(tunnel);
    let tdma = installation.tdma.clone().unwrap();
    assert_eq!(tdma, Tdma { tunnel, ..table() }, "what is computed is what runs");
    let (computed, runs) = (installation.network.unwrap(), runs.network);
    assert_eq!((computed.datagram_bytes_max, computed.bulk_below), (runs.datagram_bytes_max, runs.bulk_below));
    bounds(&installation).iter().map(|bound| bound.latency.unwrap().latency.as_nanos() as u64).collect()
}

/// Tells threads to end when it is dropped: also by an assertion that fails meanwhile, for a scope waits for them.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Publishes the packages of a flow, and says when each was published.
fn publish(mut sender: Sender, flow: usize, ends: &AtomicBool) -> Vec<u64> {
    let (from, _, bytes) = FLOWS[flow];
    let (body, mut published) = (vec![7; bytes], Vec::new());
    while !ends.load(Ordering::Relaxed) {
        sender.send(&label(from, 100, published.len() as u16), &[&body]).unwrap();
        // Behind it: a process that is held up between the two must not look like a late router.
        published.push(monotonic_ns());
        std::thread::sleep(PERIOD);
    }
    published
}

/// How many packages of each flow have come.
struct Come {
    receivers: Vec<Receiver>,
    packages: [usize; FLOWS.len()],
}

impl Come {
    fn look(&mut self) {
        for (to, receiver) in (0..NODES).zip(&mut self.receivers) {
            while let Some(package) = receiver.try_receive() {
                let from = package.head().from;
                let flow = FLOWS.iter().position(|flow| (module(flow.0), flow.1) == (from, to)).unwrap();
                assert_eq!(usize::from(package.head().id), self.packages[flow], "flow {flow}: one was lost");
                self.packages[flow] += 1;
            }
        }
    }

    /// Until nothing is under way any more.
    fn all(&mut self, published: &[Vec<u64>]) {
        let began = Instant::now();
        while self.packages.iter().zip(published).any(|(come, published)| *come < published.len()) {
            assert!(began.elapsed() < PATIENCE, "{:?} came", self.packages);
            std::thread::sleep(Duration::from_millis(1));
            self.look();
        }
    }
}

/// A package of a flow, from its publishing until it crossed the bridge.
struct Way {
    flow: usize,
    published_ns: u64,
    crossed_ns: u64,
}

/// Declared flows, until something is done: none of their packages is lost, and each keeps its bound if its router kept
/// its slots.
pub(crate) fn flows_keep_their_bounds(
    segment: &Segment,
    stalls: &Stalls,
    beside: &str,
    mut is_done: impl FnMut() -> bool,
) -> Result<(), Late> {
    let bounds_ns = bounds_ns(segment);
    let receivers = segment.stations.iter().map(Station::receiver).collect();
    let mut come = Come { receivers, packages: [0; FLOWS.len()] };
    let senders = FLOWS.map(|(from, to, _)| segment.stations[usize::from(from)].sender(to));
    let (capture, ends) = (Capture::start(&segment.lab), AtomicBool::new(false));
    let published: Vec<Vec<u64>> = std::thread::scope(|scope| {
        let publish = |(flow, sender)| {
            let ends = &ends;
            scope.spawn(move || publish(sender, flow, ends))
        };
        let threads: Vec<_> = senders.into_iter().enumerate().map(publish).collect();
        let ending = Ends(&ends);
        while !is_done() {
            come.look();
            std::thread::sleep(Duration::from_millis(1));
        }
        drop(ending);
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(published.iter().all(|times_ns| !times_ns.is_empty()), "each flow publishes");
    come.all(&published);
    let crossed = capture.end();
    assert_inside(beside, segment, &validate(&crossed, segment.time_of(0)));
    let ways = ways(&crossed, &published);
    are_excused(segment, stalls, &ways, &bounds_ns)
}

/// Each package, as the bridge saw it.
fn ways(crossed: &[Crossed], published: &[Vec<u64>]) -> Vec<Way> {
    let heads = crossed.iter().flat_map(|frame| frame.heads.iter().map(move |head| (frame, head)));
    let flows = heads.filter(|(frame, head)| head.from == module(frame.from));
    let seen: BTreeMap<_, _> =
        flows.map(|(frame, head)| ((frame.from, head.to.instance(), head.id), frame.at_ns)).collect();
    let way = |flow: usize, id: usize, published_ns: u64| {
        let (from, to, _) = FLOWS[flow];
        Way { flow, published_ns, crossed_ns: seen[&(from, to, id as u16)] }
    };
    let of = |(flow, published): (usize, &Vec<u64>)| {
        published.iter().enumerate().map(move |(id, at_ns)| (flow, id, *at_ns)).collect::<Vec<_>>()
    };
    published.iter().enumerate().flat_map(of).map(|(flow, id, at_ns)| way(flow, id, at_ns)).collect()
}

/// What is later than its bound is explained by a stall: by one that kept the package up itself, or that made its
/// router leave a slot out.
fn are_excused(segment: &Segment, stalls: &Stalls, ways: &[Way], bounds_ns: &[u64]) -> Result<(), Late> {
    let (mut left_out, mut unseen) = (0, Vec::new());
    for way in ways {
        let took_ns = way.crossed_ns.saturating_sub(way.published_ns);
        let Some(by_ns) = took_ns.checked_sub(bounds_ns[way.flow]).filter(|by_ns| *by_ns > 0) else { continue };
        let (flow, by) = (way.flow, Duration::from_nanos(by_ns));
        let (since, until) = (instant(way.published_ns), instant(way.crossed_ns));
        let log = told(segment, FLOWS[flow].0, way.crossed_ns);
        if !log.has_left_out(way.published_ns, way.crossed_ns) {
            let what = format!("a package of flow {flow} was {by:?} later than its bound, and no slot was left out");
            return Err(Late { what, since, until, by });
        }
        left_out += 1;
        // A slot is left out by a stall of so much at least.
        let by_least = Duration::from_nanos(GATE_NS);
        if stalls.stalled(since, until) < by_least {
            let what = format!("a package of flow {flow} was {by:?} later than its bound, and a slot was left out");
            unseen.push(Late { what, since, until, by: by_least });
        }
    }
    println!("of {} packages {left_out} were late by slots left out, {} without a stall", ways.len(), unseen.len());
    let is_much = unseen.len() * UNSEEN > ways.len();
    unseen.pop().filter(|_| is_much).map_or(Ok(()), Err)
}

/// With the flows declared: then routers look closely at how late slots are.
pub(crate) fn segment(tunnel: Option<Tunnel>) -> Option<Segment> {
    let mut segment = Segment::at_rest(tunnel)?;
    let flow = |(from, to, bytes): (u8, u8, usize)| Flow {
        from: vec![module(from)],
        to: vec![module(to)],
        carries: None,
        size: bytes as u32,
        period: PERIOD,
        deadline: PATIENCE,
        bound: None,
    };
    let Segment { stations, lab, .. } = &mut segment;
    for station in stations {
        station.settings.flows = FLOWS.into_iter().filter(|flow| flow.0 == station.own).map(flow).collect();
        station.start(lab);
    }
    Some(segment)
}
