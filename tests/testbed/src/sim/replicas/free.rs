//! Replicas where there are no time slots: the driver of the shell on a simulated platform.

use super::leaving::{Leaving, NoPackages};
use super::{NodeTime, Replicas};
use crate::sim::clock::Now;
use crate::sim::station::{Arrived, Io, Layer, Port};
use rohrpost_routers::driver::{NotSent, Outlet, OutletStep, ReplicaDriver};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::outbound::Outbound;
use rohrpost_routers::report::Report;
use rohrpost_routers::settings::Settings;

/// The threads of replicas of one incarnation of a router.
pub(in crate::sim) struct FreeReplicas {
    replicas: Replicas,
    driver: ReplicaDriver,
    /// When something is due for the thread that sends, ns of its monotonic clock.
    due_ns: u64,
    /// Nothing wakes it before.
    is_deaf: bool,
}

/// What the driver has of the simulated computer.
struct PartSystem<'a, 'b> {
    leaving: &'a mut Leaving,
    io: &'a mut Io<'b>,
}

impl Outlet for PartSystem<'_, '_> {
    fn monotonic_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        (self.leaving.queue(), NoPackages)
    }

    fn seals(&self) -> bool {
        self.io.plan.sealed
    }

    fn send(&mut self, _: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent> {
        self.leaving.hand_over(self.io, to, &buffer[..bytes])
    }

    fn send_parts(&mut self, _: u64, _: NodeIndex, _: &[u8], _: &[u8]) -> Result<(), NotSent> {
        // No package comes here.
        Err(NotSent)
    }

    fn retry(&mut self, _: u64) {}

    fn blocked(&self) -> (u64, u64) {
        (0, u64::MAX)
    }

    fn deliver(&mut self, _: u64) -> u64 {
        u64::MAX
    }
}

impl FreeReplicas {
    pub(in crate::sim) fn new(replicas: Replicas, settings: &Settings) -> Self {
        Self { replicas, driver: ReplicaDriver::new(settings), due_ns: 0, is_deaf: false }
    }

    /// Whether the thread that sends is awake: it is woken by records and by requests.
    fn is_awake(&mut self, io: &Io<'_>) -> bool {
        let sender = &mut self.replicas.sender;
        let (readers, has_requests) = sender.waits_on();
        let is_woken = !self.is_deaf && (has_requests() || readers.iter().any(|reader| reader.has_next()));
        is_woken || self.due_ns <= io.now.monotonic_ns
    }

    /// The thread that sends runs until it sleeps.
    fn run(&mut self, io: &mut Io<'_>) {
        self.replicas.look(io);
        let (Replicas { sender, leaving, rings, .. }, time) = (&mut self.replicas, NodeTime::of(io));
        let system = |real_ns| time.at(rings.simulated_ns(real_ns));
        let for_ns = loop {
            match self.driver.poll(&mut PartSystem { leaving, io }, system, sender) {
                OutletStep::Again => {}
                OutletStep::Sleep { for_ns } => {
                    self.is_deaf = true;
                    break for_ns;
                }
                OutletStep::Wait { for_ns } => {
                    self.is_deaf = false;
                    break for_ns;
                }
            }
        };
        self.due_ns = io.now.monotonic_ns.saturating_add(for_ns);
    }
}

impl Layer for FreeReplicas {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        self.replicas.handle(io, arrived);
    }

    fn left(&mut self, _: &mut Io<'_>, _: Port, _: u64, _: Now) {}

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        let idle_ns = self.replicas.receive(io);
        if self.is_awake(io) {
            self.run(io);
        }
        self.due_ns.min(idle_ns)
    }

    fn dies(&mut self, _: &mut Io<'_>) {}

    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.replicas.check(io, well);
    }

    fn close(&mut self, io: &mut Io<'_>) {
        self.replicas.close(io);
    }
}
