//! What the way without a server costs: one datagram beside a hop of the LAN, and the hellos of a whole team beside
//! bare datagrams.

use crate::cases::lan::ground::LanSegment;
use crate::lan::ends::Module;
use crate::lan::nodes::{ETHERNET, UNPACED};
use crate::lan::wire::{Wire, address};
use crate::team::bare::BareRobot;
use crate::team::relay::Relays;
use crate::team::robots::{Chatter, OurRobot};
use crate::team::systems::{TeamSystems, bench};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, End, Failure, Placement, Scheduling, settle, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_team::group::{HELLO_ENTRY_BYTES, HELLO_HEAD_BYTES};
use std::cell::Cell as Counter;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Duration;

const ROBOTS: u8 = 64;
const ROBOTS_QUICK: u8 = 4;
const WARM_UP: Duration = Duration::from_secs(3);
const COUNTED: Duration = Duration::from_secs(5);
const QUICK: Duration = Duration::from_secs(1);

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    [64, 1024].map(hop).into_iter().chain([hellos()]).collect()
}

fn hop(bytes: usize) -> Case {
    Case::new("team hop", bytes, "us", move |settings, subject| {
        let (team, lan) = (TeamGround::hop(settings), LanSegment::new(settings, &UNPACED));
        let cell = Cell::hop(bytes, settings.count(Cell::HOP_MESSAGES));
        let contenders = [
            Contender::sampled("rohrpost", || team.time(&cell)),
            Contender::sampled("hop of a LAN", || lan.time(&cell)).beside(at_most(1.2), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

fn hellos() -> Case {
    Case::new("64 robots, 2 Hz", None, "ms/s", |settings, subject| {
        let (robots, span) = if settings.quick { (ROBOTS_QUICK, QUICK) } else { (ROBOTS, COUNTED) };
        let bytes = HELLO_HEAD_BYTES + usize::from(robots - 1) * HELLO_ENTRY_BYTES;
        let chatter = Chatter { robots, bytes, warm_up: span.min(WARM_UP), counted: span };
        let team = TeamGround::loopback(settings, robots);
        let contenders = [
            Contender::single("rohrpost", || team.cost(&chatter)),
            Contender::single("bare datagrams", || team.bare_cost(&chatter)).beside(at_most(3.0), None),
            Contender::single("bare relays", || team.relay_cost(&chatter)),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// What the turns of a case share: a network of its own, and systems with their routers on it.
struct TeamGround {
    /// None if the system allows no namespaces.
    wire: Result<Wire, Failure>,
    /// None without the command, or if it does not start.
    systems: Result<TeamSystems, Failure>,
    turns: Counter<u8>,
}

impl TeamGround {
    /// Two systems, one at each end.
    fn hop(settings: &Settings) -> Self {
        Self::new(settings, &[End::Ping, End::Pong].map(address), |wire, system| {
            let end = if system == 1 { End::Ping } else { End::Pong };
            wire.enter(end)?;
            settle(end, Placement::TwoCores, Scheduling::Normal)
        })
    }

    /// So many systems on the loopback device of one end.
    fn loopback(settings: &Settings, robots: u8) -> Self {
        Self::new(settings, &vec![LOOPBACK.into(); robots.into()], |wire, _| wire.enter(End::Ping))
    }

    fn new(settings: &Settings, addresses: &[IpAddr], enter: fn(&Wire, u8) -> Result<(), Failure>) -> Self {
        let wire = Wire::new(ETHERNET);
        let systems = wire
            .as_ref()
            .map_err(Clone::clone)
            .and_then(|wire| TeamSystems::start(settings.command(), addresses, |system| enter(wire, system)));
        Self { wire, systems, turns: Counter::new(0) }
    }

    fn turn(&self) -> Result<(&TeamSystems, u8), Failure> {
        let turn = self.turns.get();
        self.turns.set(turn.wrapping_add(1));
        Ok((self.systems.as_ref().map_err(Clone::clone)?, turn))
    }

    /// One way from module to module, µs.
    fn time(&self, cell: &Cell) -> Result<Vec<f64>, Failure> {
        let (systems, turn) = self.turn()?;
        time_two_processes(cell, |end, meetings| {
            let [own, other] = [end, end.other()].map(|end| 1 + end.index() as u8);
            let names = [own, other].map(|system| bench(system, turn));
            Module::between(&systems.directory(own), names, cell.bytes, meetings)
        })
    }

    /// Of robots and routers, ms of processor time a second.
    fn cost(&self, chatter: &Chatter) -> Result<f64, Failure> {
        let (systems, turn) = self.turn()?;
        chatter.cost(&systems.pids(), |system| OurRobot::open(systems, system, turn, chatter.bytes))
    }

    /// Of processes that hand datagrams over to robots, and nothing else: what any router costs.
    fn relay_cost(&self, chatter: &Chatter) -> Result<f64, Failure> {
        let wire = self.wire.as_ref().map_err(Clone::clone)?;
        let enter = || wire.enter(End::Pong);
        let relays = Relays::start(chatter.robots, LOOPBACK, chatter.bytes, enter)?;
        chatter.cost(&relays.pids(), |system| enter().and_then(|()| relays.robot(system)))
    }

    /// Of sockets without routers; they are on another node, so that neither hears the other.
    fn bare_cost(&self, chatter: &Chatter) -> Result<f64, Failure> {
        let wire = self.wire.as_ref().map_err(Clone::clone)?;
        chatter.cost(&[], |_| {
            wire.enter(End::Pong)?;
            BareRobot::open(LOOPBACK, chatter.bytes)
        })
    }
}

const LOOPBACK: Ipv4Addr = Ipv4Addr::LOCALHOST;
