//! crossbeam's channel between two threads of one process: no shared memory, no dead peers, no priorities.

use crossbeam_channel::{Receiver, Sender, TryRecvError, bounded};
use rohrpost_bench_local::harness::{Failure, Link, OrFail};

/// Messages that may wait; in ping-pong more than one never does.
const DEPTH: usize = 64;

/// One end, for messages of N bytes, which are moved in and out.
pub struct Channel<const N: usize> {
    out: Sender<[u8; N]>,
    back: Receiver<[u8; N]>,
}

/// Both ends.
pub fn pair<const N: usize>() -> [Channel<N>; 2] {
    let ((out, far_back), (far_out, back)) = (bounded(DEPTH), bounded(DEPTH));
    [Channel { out, back }, Channel { out: far_out, back: far_back }]
}

impl<const N: usize> Link for Channel<N> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let message = message.try_into().or_fail("message")?;
        self.out.send(message).or_fail("channel")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        loop {
            match self.back.try_recv() {
                Ok(received) => {
                    message.copy_from_slice(&received);
                    return Ok(());
                }
                Err(TryRecvError::Empty) => std::hint::spin_loop(),
                Err(error) => return Err(Failure::of("channel", error)),
            }
        }
    }
}
