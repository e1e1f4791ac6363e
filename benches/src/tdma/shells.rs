//! Routers of three nodes as threads of one process. Their clocks are wrong on purpose, so that the true error of each
//! is known.

use super::plan::Plan;
use super::stage::{NODES, Place, Stage};
use crate::lan::router::{ROUTER, SYSTEM};
use crate::lan::skewed::{SKEW, Shown};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{OrFail, Scratch, look_for};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, monotonic_ns, realtime_ns};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::shell::clock::{ClockParts, Skew};
use rohrpost_routers::shell::{Faults, Parts, Shell, Undelivered};
use rohrpost_routers::time::Role;
use std::sync::Arc;
use std::time::Duration;

/// As many exchanges as the filter of a clock holds.
const SETTLED: u64 = 64;
const SETTLES_WITHIN: Duration = Duration::from_secs(60);
const LOOK_EACH: Duration = Duration::from_millis(5);

/// No commands are used here.
struct Silence;

impl Faults for Silence {
    fn write(&self, _: &[u8], _: &Undelivered<'_>, _: &mut Vec<u8>) -> bool {
        false
    }
}

/// One node: the error of its clock, and its router while it runs.
struct Member {
    skew: Skew,
    shell: Option<Shell>,
}

/// Three of them, until this is dropped.
pub struct Shells {
    members: Vec<Member>,
}

impl Shells {
    /// Starts them, in a process of their own, since it moves from node to node. The first node's clock is right.
    ///
    /// # Errors
    /// When a router does not start.
    pub fn start(stage: &Stage, plan: &Plan, scratch: &Scratch) -> Result<Self, Failure> {
        let installation = plan.installation()?;
        let members = (0..NODES).map(|node| Member::start(stage, &installation, node, scratch));
        Ok(Self { members: members.collect::<Result<_, _>>()? })
    }

    /// Waits until all others follow one master (the first one, or its successor after a standstill) and have measured
    /// enough. Returns the master.
    ///
    /// # Errors
    /// What they show, if one does not.
    pub fn await_settled(&self) -> Result<u8, Failure> {
        let settled =
            |master: &u8| (0..).zip(&self.members).all(|(node, member)| node == *master || member.is_settled());
        let master = look_for(SETTLES_WITHIN, LOOK_EACH, || Ok(self.master().filter(settled)))?;
        master.ok_or_else(|| {
            let shells = self.members.iter().filter_map(|member| member.shell.as_ref()?.clock());
            let seen: Vec<_> = shells.map(|clock| clock.snapshot()).collect();
            Failure::Failed(format!("a slave has no time: {seen:?}"))
        })
    }

    /// The node that takes itself for the master, if there is exactly one.
    pub fn master(&self) -> Option<u8> {
        let mut masters = (0..NODES).zip(&self.members).filter(|(_, member)| member.is(Role::Master));
        masters.next().map(|(node, _)| node).filter(|_| masters.next().is_none())
    }

    /// Ends the routers of these nodes.
    pub fn end(&mut self, nodes: std::ops::Range<u8>) {
        for member in &mut self.members[usize::from(nodes.start)..usize::from(nodes.end)] {
            member.shell = None;
        }
    }

    /// What a node has for its time page.
    ///
    /// # Errors
    /// When its router has ended.
    pub fn shown(&self, node: u8) -> Result<Shown, Failure> {
        let Member { skew, shell } = &self.members[usize::from(node)];
        let clock = shell.as_ref().and_then(Shell::clock);
        let clock = clock.ok_or_else(|| Failure::Failed(format!("node {node} shows no time")))?;
        Ok(Shown { record: clock.snapshot().record, skew: *skew })
    }
}

impl Member {
    fn start(stage: &Stage, installation: &Installation, own: u8, scratch: &Scratch) -> Result<Self, Failure> {
        let place = Place::Node(own);
        stage.enter(place)?;
        let node = Node::create(&scratch.directory().join(place.name()), 0o700).or_fail("node")?;
        let settings = Settings::new(installation, &place.name(), realtime_ns()).or_fail("configuration")?;
        let skew = if own == 0 {
            Skew::default()
        } else {
            Skew { begin_ns: monotonic_ns(), offset_ns: u64::from(own) * SKEW.offset_ns, ..SKEW }
        };
        // A page is written and read by this computer's clock, which differs from the node's clock here: so nobody
        // writes it.
        let clock = ClockParts::new(&settings, installation, &node);
        let clock = clock.map(|parts| ClockParts { skew: Some(skew), node: None, ..parts });
        let name = Name::new(SYSTEM, ROUTER.0, own, 0);
        let faults = Arc::new(Silence);
        let parts = Parts { node: &node, name, settings, faults, sockets: Vec::new(), impair: None, clock };
        let shell = Shell::start(parts).or_fail("router")?;
        Ok(Self { skew, shell: Some(shell) })
    }

    fn is(&self, role: Role) -> bool {
        self.shell.as_ref().and_then(Shell::clock).is_some_and(|clock| clock.snapshot().role == role)
    }

    fn is_settled(&self) -> bool {
        let clock = self.shell.as_ref().and_then(Shell::clock);
        let seen = clock.map(|clock| clock.snapshot());
        seen.is_some_and(|seen| seen.synchronised && seen.role == Role::Slave && seen.exchanges >= SETTLED)
    }
}
