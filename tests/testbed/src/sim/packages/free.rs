//! Packages where there are no time slots: the driver of the shell on a simulated platform.

use super::{LISTEN_NS, Packages};
use crate::sim::clock::Now;
use crate::sim::promise::Promise;
use crate::sim::station::{Arrived, Io, Layer, Port};
use rohrpost_mailbox::Priority;
use rohrpost_routers::driver::{FreeDriver, FreeStep, Inlet, NotSent, Outlet, Wakes};
use rohrpost_routers::frame::{HEAD_BYTES, NodeIndex};
use rohrpost_routers::outbound::{Outbound, Package};
use rohrpost_routers::report::Report;
use rohrpost_routers::settings::Settings;
use std::sync::Arc;

/// One incarnation of a router that sends as packages come.
pub(crate) struct Free {
    packages: Packages,
    driver: FreeDriver,
    /// When something is due for the thread that sends, at the latest, ns of its monotonic clock.
    due_ns: u64,
    wakes: Wakes,
}

/// What the driver has of the simulated computer.
struct FreeSystem<'a, 'b> {
    packages: &'a mut Packages,
    io: &'a mut Io<'b>,
    /// The driver has taken a package since it was polled.
    has_taken: bool,
}

impl FreeSystem<'_, '_> {
    /// A package leaves at once. In a datagram of its own it does only if none waits behind it, or no second one of its
    /// size would fit.
    fn leaves_alone(&mut self, head: &[u8], body: &[u8]) {
        self.io.oracle.saw("sent at once");
        let two_bytes = 2 * (head.len() + body.len()) - HEAD_BYTES;
        if !self.io.host.transit.is_empty() && two_bytes <= self.packages.settings.network.datagram_bytes_max {
            let text = format!("{} bytes leave alone, and more wait in the mailbox", body.len());
            self.io.oracle.broken(self.io.now, Promise::Pace, text);
        }
    }

    /// With plenty in the queue the driver takes one package each time it is polled, the most important: what it took
    /// of a flood would only be lost to its quota. Where datagrams are sealed, what waits for a session does not count.
    fn takes(&mut self) {
        let shape = &self.io.plan.shape;
        let plenty_bytes = (2 * shape.datagram_bytes_max).max(shape.quota_bytes / 2);
        let waiting_bytes = self.io.oracle.waiting_bytes(self.io.life);
        let is_plenty = self.packages.seals.is_none() && waiting_bytes >= plenty_bytes;
        if self.has_taken && is_plenty && !self.io.host.transit.is_empty() {
            let text = format!("node {} takes more, and {waiting_bytes} bytes wait in its queue", self.io.node);
            self.io.oracle.broken(self.io.now, Promise::Bounded, text);
        }
        self.has_taken = true;
    }
}

impl Outlet for FreeSystem<'_, '_> {
    fn monotonic_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        self.packages.queue(self.io)
    }

    fn seals(&self) -> bool {
        self.packages.seals.is_some()
    }

    fn send(&mut self, _: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent> {
        self.packages.hand_over(self.io, to, &buffer[..bytes])
    }

    fn send_parts(&mut self, _: u64, to: NodeIndex, head: &[u8], body: &[u8]) -> Result<(), NotSent> {
        self.leaves_alone(head, body);
        self.packages.hand_over(self.io, to, &[head, body].concat())
    }

    fn retry(&mut self, _: u64) {}

    fn blocked(&self) -> (u64, u64) {
        (0, u64::MAX)
    }

    fn deliver(&mut self, _: u64) -> u64 {
        u64::MAX
    }
}

impl Inlet for FreeSystem<'_, '_> {
    type Outlet = Self;

    fn outlet(&mut self) -> &mut Self {
        self
    }

    fn first(&mut self) -> Option<Priority> {
        self.io.host.transit.waits().1
    }

    fn take<T>(&mut self, what: impl FnOnce(&mut Self, &Package<'_>, &dyn Fn() -> bool) -> T) -> Option<T> {
        self.takes();
        let parcel = loop {
            let parcel = self.packages.take_parcel(self.io)?;
            if !self.io.is_intruders(&parcel) {
                break parcel;
            }
            self.packages.accept_uncapped(self.io, &parcel);
            self.packages.took(self.io, parcel);
        };
        let is_alone = self.io.host.transit.is_empty();
        let package = Package { head: parcel.head, published_ns: parcel.published_ns, body: &parcel.body };
        let result = what(self, &package, &|| is_alone);
        self.packages.took(self.io, parcel);
        Some(result)
    }
}

impl Free {
    pub(crate) fn new(packages: Packages, settings: &Settings) -> Self {
        let driver = FreeDriver::new(&Arc::new(settings.clone()));
        Self { packages, driver, due_ns: 0, wakes: Wakes::Any }
    }

    /// The thread that receives sends its refusals and hellos itself.
    fn answer(&mut self, io: &mut Io<'_>) {
        while let Some(answer) = self.packages.next_answer() {
            let to = answer.to(&self.packages.settings);
            self.packages.send_answer(io, to, answer.datagram());
        }
    }

    /// Whether the thread that sends is awake now.
    fn is_awake(&mut self, io: &Io<'_>) -> bool {
        let first = io.host.transit.waits().1;
        let is_woken = match self.wakes {
            Wakes::Any => first.is_some(),
            Wakes::Above(least) | Wakes::AboveOrRoom(least) => first.is_some_and(|first| first.outranks(least)),
        };
        let is_rung = std::mem::take(&mut self.packages.is_rung);
        is_woken || is_rung || self.due_ns <= io.now.monotonic_ns
    }

    /// The thread that sends runs until it sleeps.
    fn run(&mut self, io: &mut Io<'_>) {
        let Self { packages, driver, .. } = self;
        let (until_ns, is_exact, wakes) = loop {
            if let FreeStep::Sleep { until_ns, is_exact, wakes } =
                driver.poll(&mut FreeSystem { packages, io, has_taken: false })
            {
                break (until_ns, is_exact, wakes);
            }
        };
        // Without a timer the thread that receives wakes it, within its own period.
        let late_ns = if is_exact { 0 } else { io.chance.below(LISTEN_NS) };
        (self.due_ns, self.wakes) = (until_ns.saturating_add(late_ns), wakes);
    }
}

impl Layer for Free {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        self.packages.handle(io, arrived);
        self.answer(io);
    }

    fn left(&mut self, _: &mut Io<'_>, _: Port, _: u64, _: Now) {}

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        let idle_ns = self.packages.receive(io);
        self.answer(io);
        if self.is_awake(io) {
            self.run(io);
        }
        self.due_ns.min(idle_ns)
    }

    fn dies(&mut self, io: &mut Io<'_>) {
        self.packages.dies(io);
    }

    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.packages.check(io, well);
    }

    fn close(&mut self, io: &mut Io<'_>) {
        self.packages.close(io);
    }
}
