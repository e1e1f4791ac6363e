//! Contenders of ping-pong beside ours, in addition to the floors of `rohrpost bench local`.

use crate::floors::{Queue, QueueSink, SlotMemory, SlotReceiver, SlotSender};
use crate::one_way::Duplex;
use crate::peers::{Iceoryx, Waits, pair};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::hand_over::Wake;
use rohrpost_bench_local::harness::{Cell, Scratch, Shared, time_two_processes, time_two_threads};
use rohrpost_bench_local::latency::{Rival, TOUCHED, hand_over};

/// Bytes of [`SPIN_SMALL`].
const SMALL: usize = 64;
/// Messages in a queue of the kernel, of which at most one waits. Few, since large messages reach RLIMIT_MSGQUEUE, 800
/// KiB for all queues of a user.
const QUEUE_DEPTH: usize = 4;

/// Bare shared memory, polled, with [`SMALL`] bytes, whatever the size of the case: the floor of messages that are not
/// copied.
pub(super) const SPIN_SMALL: Rival =
    Rival { name: "spin 64 B", turn: |cell| hand_over(&Cell { bytes: SMALL, ..*cell }, Wake::Spin) };

/// The least that slots with priorities cost, polled.
pub(super) const SLOT_CORE: Rival = Rival {
    name: "slot core",
    turn: |cell| {
        let pair = Shared::<[SlotMemory; 2]>::new()?;
        time_two_processes(cell, |end, _| {
            let [out, back] = [end, end.other()].map(|end| &pair[end.index()]);
            Ok(Duplex(SlotSender::new(out, cell.bytes, 100), SlotReceiver::new(back, cell.bytes)))
        })
    },
};

/// The kernel's priority queue.
pub(super) const POSIX_QUEUE: Rival = Rival {
    name: "posix-mq",
    turn: |cell| {
        let queues = [Queue::new(QUEUE_DEPTH, cell.bytes)?, Queue::new(QUEUE_DEPTH, cell.bytes)?];
        time_two_processes(cell, |end, _| {
            let [out, back] = [end, end.other()].map(|end| &queues[end.index()]);
            Ok(Duplex(QueueSink::new(out, 0), back))
        })
    },
};

pub(super) const ICEORYX_LISTENER: Rival =
    Rival { name: "iceoryx2 listener", turn: |cell| iceoryx(cell, cell.bytes, Waits::Listener) };

pub(super) const ICEORYX_SPINNING: Rival =
    Rival { name: "iceoryx2 spinning", turn: |cell| iceoryx(cell, cell.bytes, Waits::Spinning) };

pub(super) const ICEORYX_LOANED: Rival = Rival {
    name: "iceoryx2 loaned",
    turn: |cell| iceoryx(&Cell { bytes: TOUCHED, ..*cell }, cell.bytes, Waits::Loaned),
};

/// Between threads of one process.
pub(super) const CROSSBEAM: Rival = Rival {
    name: "crossbeam, 1 process",
    turn: |cell| match cell.bytes {
        64 => time_two_threads(cell, pair::<64>),
        1024 => time_two_threads(cell, pair::<1024>),
        16_384 => time_two_threads(cell, pair::<16_384>),
        bytes => Err(Failure::Skipped(format!("its messages are types; there is none of {bytes} B"))),
    },
};

fn iceoryx(cell: &Cell, bytes: usize, waits: Waits) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    time_two_processes(cell, |end, meetings| Iceoryx::open(&scratch, end, bytes, waits, meetings))
}
