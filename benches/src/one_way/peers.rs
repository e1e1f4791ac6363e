//! iceoryx2 between processes and crossbeam's channel between threads, one way.

use super::{Sink, Source, Stream, StreamTurn, receive_all, send_all};
use crate::peers::{IceoryxReceiver, IceoryxSender};
use crossbeam_channel::{Receiver, Sender, bounded};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, End, OrFail, Placement, Scratch, Shared, settle};
use std::time::Instant;

/// How many messages wait at most.
const DEPTH: usize = crate::floors::ring::DEPTH;

/// Messages a second through iceoryx2; the receiver spins, or waits for a notifier.
///
/// # Errors
/// As [`super::rate`].
pub fn iceoryx_rate(stream: &Stream, listens: bool) -> Result<f64, Failure> {
    let scratch = Scratch::new()?;
    let sink = |_| IceoryxSender::open(&scratch, stream.bytes, DEPTH, listens);
    super::rate(stream, sink, || IceoryxReceiver::open(&scratch, DEPTH, listens))
}

struct ChannelSink<const N: usize>(Sender<[u8; N]>);

impl<const N: usize> Sink for ChannelSink<N> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let message = message.try_into().or_fail("message")?;
        self.0.send(message).or_fail("channel")
    }
}

struct ChannelSource<const N: usize>(Receiver<[u8; N]>);

impl<const N: usize> Source for ChannelSource<N> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        message.copy_from_slice(&self.0.recv().or_fail("channel")?);
        Ok(())
    }
}

/// Messages a second through crossbeam's channel, between two threads of a process of its own.
///
/// # Errors
/// As [`super::rate`].
pub fn channel_rate(stream: &Stream) -> Result<f64, Failure> {
    match stream.bytes {
        64 => between_threads::<64>(stream),
        4096 => between_threads::<4096>(stream),
        bytes => Err(Failure::Skipped(format!("its messages are types; there is none of {bytes} B"))),
    }
}

fn between_threads<const N: usize>(stream: &Stream) -> Result<f64, Failure> {
    let turn = Shared::<StreamTurn>::new()?;
    let process = Child::start(|| {
        let (sender, receiver) = bounded(DEPTH);
        std::thread::scope(|scope| {
            let receiving = scope.spawn(|| {
                settle(End::Pong, Placement::TwoCores, stream.scheduling)?;
                receive_all(&mut ChannelSource::<N>(receiver), stream, &turn)
            });
            settle(End::Ping, Placement::TwoCores, stream.scheduling)?;
            let sent = send_all(&mut ChannelSink(sender), stream, 0);
            receiving.join().map_err(|_| Failure::Failed("the receiving thread panicked".into()))?.and(sent)
        })
    })?;
    process.finish(Instant::now() + stream.patience())?;
    Ok(turn.rate())
}
