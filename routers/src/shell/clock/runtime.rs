//! A clock's driver and what that has of the system: its socket, the kernel's stamps, the node's page, and what others
//! may look at. The thread belongs to the owner.

use super::local::LocalClock;
use super::socket::{ReceivedDatagram, TimeSocket};
use super::state::{ClockSnapshot, ClockState};
use super::{ClockError, ClockParts};
use crate::driver::{
    ClockDriver, ClockStep, TIME_DATAGRAM_BYTES, TimeArrival, TimeEvent, TimeInput, TimePlatform, TimeStart,
};
use crate::frame::NodeIndex;
use crate::impair::{Impairment, ImpairmentStep};
use crate::security::PeerSessions;
use crate::time::{Clock, InSlots, Looked, SentId, Stamp, Unsteady};
use rohrpost_mailbox::{TimeKeeper, TimeRecord, Watched, monotonic_ns, realtime_ns};
use std::net::{IpAddr, SocketAddr};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;

/// What the impairment keeps besides the bytes.
#[derive(Clone, Copy)]
struct DelayedArrival {
    source: IpAddr,
    stamp: Stamp,
    since_ns: u64,
}

/// All of a clock but its thread.
pub(in crate::shell) struct ClockRuntime {
    pub(in crate::shell) driver: ClockDriver,
    pub(in crate::shell) system: TimeSystem,
}

/// What the driver has of the system.
pub(in crate::shell) struct TimeSystem {
    pub(in crate::shell) local: LocalClock,
    socket: TimeSocket,
    keeper: Option<TimeKeeper>,
    impairment: Option<Impairment<DelayedArrival>>,
    /// When the impairment has more, local ns.
    held_ns: u64,
    state: Arc<ClockState>,
}

impl ClockRuntime {
    /// Binds the socket. What an earlier incarnation of this router wrote in the node's page goes on.
    pub(in crate::shell) fn new(parts: ClockParts) -> Result<Self, ClockError> {
        let ClockParts { settings, nodes, node, impair, kernel_stamps, skew } = parts;
        let own = settings.own;
        let at = nodes.get(usize::from(own)).copied().unwrap_or(SocketAddr::new(IpAddr::from([0; 16]), 0));
        let socket = TimeSocket::open(at, &nodes, settings.digest, kernel_stamps)
            .map_err(|error| ClockError::Socket(at, error))?;
        let keeper = node.as_ref().map(TimeKeeper::resume).transpose()?;
        let local = LocalClock::new(skew);
        let start = TimeStart {
            looked: local.looked(),
            monotonic_ns: monotonic_ns(),
            realtime_ns: realtime_ns(),
            page: keeper.as_ref().and_then(TimeKeeper::record),
            watched: keeper.as_ref().and_then(TimeKeeper::watched),
        };
        let addresses = nodes.iter().map(SocketAddr::ip).collect();
        let (driver, unsteady) = ClockDriver::new(settings, addresses, start);
        let snapshot = ClockSnapshot::of(driver.clock(), local.now_ns());
        let mut system = TimeSystem {
            local,
            socket,
            keeper,
            impairment: impair.map(|impair| Impairment::new(impair, u64::from(own) | 0x7469_6d65_0000)),
            held_ns: u64::MAX,
            state: Arc::new(ClockState::new(snapshot)),
        };
        unsteady.into_iter().for_each(warn_unsteady);
        driver.clock().watched().into_iter().for_each(|watched| system.note_watched(&watched));
        Ok(Self { driver, system })
    }

    /// From now on it seals what it sends, and takes only what is sealed to it, if there is something to seal with.
    pub(in crate::shell) fn sealed(self, all: Option<&Arc<PeerSessions>>, in_slots: bool) -> Self {
        let Some(all) = all else { return self };
        let Self { driver, system } = self;
        let socket = system.socket.sealed();
        Self { driver: driver.sealed(all, in_slots), system: TimeSystem { socket, ..system } }
    }

    /// From now on its clock goes by the rules of time slots.
    pub(in crate::shell) fn in_slots(self, settings: InSlots) -> Self {
        Self { driver: self.driver.in_slots(settings), ..self }
    }

    /// What others may look at.
    pub(in crate::shell) fn state(&self) -> &Arc<ClockState> {
        &self.system.state
    }

    /// Does what is due: see [`ClockDriver::poll`].
    pub(super) fn poll(&mut self) -> ClockStep {
        self.driver.poll(&mut self.system)
    }
}

impl TimePlatform for TimeSystem {
    fn local_ns(&self) -> u64 {
        self.local.now_ns()
    }

    fn monotonic_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn looked(&self) -> Looked {
        self.local.looked()
    }

    fn next_left(&mut self) -> Option<(SentId, Stamp)> {
        loop {
            let (id, realtime_ns) = self.socket.sent()?;
            if let Some(stamp) = self.local.stamp(realtime_ns) {
                return Some((id, stamp));
            }
        }
    }

    fn receive(&mut self, datagram: &mut [u8; TIME_DATAGRAM_BYTES]) -> TimeInput {
        let came = self.socket.receive(datagram).map(|ReceivedDatagram { bytes, source, realtime_ns }| {
            let now_ns = self.local.now_ns();
            let stamp = realtime_ns.and_then(|ns| self.local.stamp(ns)).unwrap_or(Stamp::by_us(now_ns));
            (now_ns, TimeArrival { bytes, source, stamp })
        });
        let Some(impairment) = &mut self.impairment else {
            return came.map_or(TimeInput::Nothing, |(_, came)| TimeInput::Datagram(came));
        };
        if let Some((since_ns, TimeArrival { bytes, source, stamp })) = came {
            impairment.push(since_ns, DelayedArrival { source, stamp, since_ns }, &datagram[..bytes]);
        }
        match self.take_held(datagram) {
            Some(held) => TimeInput::Datagram(held),
            None if came.is_some() => TimeInput::Kept,
            None => TimeInput::Nothing,
        }
    }

    fn held_ns(&self) -> u64 {
        self.held_ns
    }

    fn send(&mut self, to: NodeIndex, datagram: &[u8]) {
        self.socket.send(to, datagram);
    }

    fn write(&mut self, record: &TimeRecord) -> bool {
        self.keeper.as_mut().is_none_or(|keeper| keeper.write(record))
    }

    fn page(&self) -> Option<TimeRecord> {
        self.keeper.as_ref().and_then(TimeKeeper::record)
    }

    fn note_watched(&mut self, watched: &Watched) {
        self.keeper.iter_mut().for_each(|keeper| keeper.note_watched(watched));
    }

    fn publish(&mut self, clock: &Clock, ignored: u64) {
        let seen = ClockSnapshot::of(clock, self.local.now_ns());
        self.state.show(&ClockSnapshot { ignored, ..seen });
    }

    fn take_new_epoch(&mut self) -> Option<u64> {
        self.state.take_new_epoch().then(realtime_ns)
    }

    fn happened(&mut self, _: &Clock, event: TimeEvent<'_>) {
        match event {
            TimeEvent::Unsteady { why, is_new: true } => warn_unsteady(why),
            TimeEvent::NotOpened { source, why: Some((why, datagrams)) } => {
                tracing::warn!("takes no time from {source}: {why} (datagrams: {datagrams})");
            }
            _ => {}
        }
    }
}

impl TimeSystem {
    /// What the impairment has kept for long enough came so much later.
    fn take_held(&mut self, datagram: &mut [u8; TIME_DATAGRAM_BYTES]) -> Option<TimeArrival> {
        let now_ns = self.local.now_ns();
        match self.impairment.as_mut()?.poll(now_ns) {
            ImpairmentStep::Send { to: DelayedArrival { source, stamp, since_ns }, datagram: held } => {
                let bytes = held.len().min(datagram.len());
                datagram[..bytes].copy_from_slice(&held[..bytes]);
                self.held_ns = now_ns;
                Some(TimeArrival { bytes, source, stamp: Stamp { ns: stamp.ns + (now_ns - since_ns), ..stamp } })
            }
            ImpairmentStep::Wait { until_ns } => {
                self.held_ns = until_ns;
                None
            }
        }
    }
}

fn warn_unsteady(why: Unsteady) {
    tracing::warn!("nothing is known of the time until it has been measured anew: {why}");
}

impl AsFd for ClockRuntime {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.system.socket.as_fd()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "these are tests")]

    use super::*;
    use crate::harness::time_settings;
    use std::net::UdpSocket;
    use std::time::Duration;

    /// A datagram that an impairment keeps counts as well: a flood would hold the thread otherwise.
    #[test]
    fn a_look_reads_a_bounded_number_of_datagrams_also_behind_an_impairment() {
        for impair in [None, Some("loss=100%"), Some("delay=5s")] {
            let peer = UdpSocket::bind(("127.9.3.2", 0)).unwrap();
            let port = peer.local_addr().unwrap().port();
            let nodes = [1, 2].map(|host| SocketAddr::from(([127, 9, 3, host], port)));
            let settings = time_settings(0, &[0], Duration::from_millis(100));
            let impair = impair.map(|text| text.parse().unwrap());
            let parts = ClockParts { impair, kernel_stamps: false, ..ClockParts::at(nodes.to_vec(), settings) };
            let mut runtime = ClockRuntime::new(parts).unwrap();
            (0..40).for_each(|_| assert_eq!(peer.send_to(&[0; 10], nodes[0]).unwrap(), 10));
            runtime.driver.take(&mut runtime.system, 16, |_, _| {});
            let socket = &mut runtime.system.socket;
            let left = std::iter::from_fn(|| socket.receive(&mut [0; TIME_DATAGRAM_BYTES])).count();
            assert_eq!(left, 24, "{impair:?}");
        }
    }
}
