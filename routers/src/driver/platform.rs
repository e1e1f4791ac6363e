//! What a slot driver has of the system, and what it tells of itself.

use super::answer::Answer;
use super::log::WindowLog;
use crate::frame::NodeIndex;
use crate::intake::Transit;
use crate::outbound::Outbound;
use crate::report::Report;
use crate::stats::Stats;
use crate::tdma::{Planned, SlotScheduler, TransmitWindow, WindowVerdict};
use crate::time::{Clock, SentId, Stamp, Step, TIME_BYTES};
use std::net::IpAddr;

/// The system took a datagram neither to send nor to keep it: its packages are lost.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the datagram was not sent")]
pub struct NotSent;

/// Clocks, mailbox, queue and sockets of a router with time slots.
pub trait Platform {
    /// The clock by which windows are planned, ns.
    fn local_ns(&self) -> u64;
    /// The clock by which packages are published, ns.
    fn monotonic_ns(&self) -> u64;
    /// What is known of system time.
    fn clock(&self) -> &Clock;
    /// The clock, to be changed, and the counters of the receiving half.
    fn time(&mut self) -> (&mut Clock, &Stats);
    /// The router's mailbox, and the queue behind it.
    fn transit(&mut self) -> impl Transit;
    /// The queue, and the receiver of reports on what it loses.
    fn queue(&mut self) -> (&mut Outbound, impl Report);
    /// Hands over the datagram in the first `bytes` of a buffer, which has room for a seal behind them.
    ///
    /// # Errors
    /// [`NotSent`]; the datagram is as it was.
    fn send(&mut self, now_ns: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent>;
    /// Hands over a datagram of time.
    fn send_time(&mut self, to: NodeIndex, datagram: &[u8; TIME_BYTES]);
    /// The next refusal or hello that the half that receives wants to have sent.
    fn next_answer(&mut self) -> Option<Answer>;
    /// Hands over a refusal or hello.
    fn send_answer(&mut self, to: IpAddr, datagram: &[u8]);
    /// Hands the clock what came: stamps of what `left`, then at most so many datagrams of time.
    fn take_time(&mut self, most: usize, left: impl FnMut(SentId, Stamp));
    /// An address that no node has, and that the time of another configuration came from, once.
    fn take_stranger(&mut self) -> Option<IpAddr>;
    /// Does between windows what is due besides.
    fn tidy(&mut self, now_ns: u64);
    /// Writes the next part of a replica into a buffer with room for the largest datagram: its receiver and its length.
    /// None: none waits, or streams are looked for just now.
    fn next_part(&mut self, _datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        None
    }
    /// Hands over a part, in the first `bytes` of a buffer that has room for a seal behind them. One that the system
    /// does not take is lost.
    fn send_part(&mut self, _to: NodeIndex, _buffer: &mut [u8], _bytes: usize) {}
    /// Lets others see how it stands.
    fn publish(&mut self, scheduler: &SlotScheduler, log: &WindowLog);
    /// The queue has become longer or shorter.
    fn queue_changed(&mut self) {}
    /// Something happened that a simulation watches, or that takes its time there.
    fn happened(&mut self, _: SlotEvent<'_>) {}
}

/// What a slot driver does.
#[derive(Clone, Copy, Debug)]
pub enum SlotEvent<'a> {
    /// It is awake for a window, and has read what came.
    Awake(&'a Planned),
    /// The clock was asked between windows, when it may send nothing.
    Idle(&'a Step),
    /// It was time for a window.
    Decided(&'a Planned, &'a WindowVerdict),
    /// A hello leaves in this window by what is only overheard.
    AnsweredOverheard(&'a TransmitWindow),
    /// A datagram of packages was made.
    Made,
    /// A datagram was made, and fits no more. `held`: it leaves first in the next slot; else it is lost.
    Missed {
        /// Its bytes.
        datagram: &'a [u8],
        /// Whether it waits.
        held: bool,
    },
    /// A datagram was held for too long, and is lost.
    DroppedOld(&'a [u8]),
    /// Packages that wait cannot keep their bounds: a slot was left out or cut short.
    LeftOut,
    /// The window is done with.
    Closed(&'a TransmitWindow),
}
