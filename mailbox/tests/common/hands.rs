//! Every hot path of sending and receiving, with other processes to wake and to be woken by. What an operation must not
//! do, the tests say that have it done: take from the heap (`hot_path`), or call the kernel (`system_calls`).

use super::board::{Board, shared};
use super::crew::{Actor, is_asleep};
use super::{Ground, HIGH, LOW, MAILBOX, OTHER, PATIENCE, label, shape, until};
use nix::unistd::Pid;
use rohrpost_mailbox::{
    Around, Interest, Name, Next, OverflowPolicy, Participant, Priority, Receiver, SendError, Sender, Shape, Stamp,
    StreamId, StreamReader, StreamShape, StreamWriter, Waiting, Watches, local, monotonic_ns, wait_any,
};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::{Duration, Instant};

const SLEEPER: Name = Name::new(1, 202, 1, 0);
const POLLER: Name = Name::new(1, 203, 1, 0);
/// A mailbox of another node, and that of the router which leads there.
const FAR: Name = Name::new(1, 204, 1, 0);
const TRANSIT: Name = Name::new(1, 250, 0, local::TRANSIT);
/// What the answerer is asked for: a package at once, or when the asker sleeps.
const AT_ONCE: u32 = 1;
const WHEN_ASLEEP: u32 = 2;
/// Often enough that nothing is left out that comes every so many times, such as looking at a word without a hint.
const OFTEN: u64 = 200;
/// Where somebody has to fall asleep first.
const SLEEPS: u64 = 20;
const SPIN: Waiting = Waiting { spin: PATIENCE, deadline: None };

/// Something that is done again and again.
pub(crate) struct Operation {
    pub(crate) name: &'static str,
    pub(crate) times: u64,
    prepare: fn(&mut Hands),
    operate: fn(&mut Hands),
}

const fn operation(name: &'static str, times: u64, prepare: fn(&mut Hands), operate: fn(&mut Hands)) -> Operation {
    Operation { name, times, prepare, operate }
}

pub(crate) const OPERATIONS: &[Operation] = &[
    operation("read the clock", OFTEN, nothing, |_| {
        assert!(monotonic_ns() > 0 && Instant::now().elapsed() < PATIENCE);
    }),
    operation("send to a receiver that is awake", OFTEN, Hands::empty, Hands::send),
    operation("loan, fill and send", OFTEN, Hands::empty, |hands| {
        let mut loan = hands.sender.loan(LOW).unwrap();
        loan.body()[..40].fill(7);
        loan.send(&label(LOW, 1), 40).unwrap();
    }),
    operation("loan and drop", OFTEN, nothing, |hands| drop(hands.sender.loan(LOW).unwrap())),
    operation("send and displace", OFTEN, |hands| hands.fill(LOW), |hands| hands.send_as(HIGH)),
    operation(
        "send and be refused",
        OFTEN,
        |hands| hands.fill(HIGH),
        |hands| assert!(matches!(hands.sender.send(&label(LOW, 1), &[]), Err(SendError::Full(_)))),
    ),
    operation("send what is too large", OFTEN, nothing, |hands| {
        assert!(matches!(hands.sender.send(&label(LOW, 1), &[&[0; 1000]]), Err(SendError::TooLarge { .. })));
    }),
    operation("send and replace one's own older", OFTEN, |hands| hands.states(&[1]), |hands| hands.state(1)),
    operation("send into one's own older slot", OFTEN, |hands| hands.states(&[1, 2]), |hands| hands.state(2)),
    operation("send to another node and take it as its router", OFTEN, nothing, |hands| {
        hands.far_sender.send(&label(LOW, 1), &[b"a", b" body"]).unwrap();
        assert_eq!(hands.transit.try_receive().unwrap().head().to, FAR);
    }),
    operation("loan, fill and send to another node", OFTEN, Hands::empty, |hands| {
        let mut loan = hands.far_sender.loan(LOW).unwrap();
        loan.body()[..40].fill(7);
        loan.send(&label(LOW, 1), 40).unwrap();
    }),
    operation("try_receive with a package there", OFTEN, Hands::send, Hands::take),
    operation("try_receive with none there", OFTEN, nothing, |hands| assert!(hands.receiver.try_receive().is_none())),
    operation("receive with a package there", OFTEN, Hands::send, |hands| drop(hands.receiver.receive())),
    operation("receive with a timeout and a package there", OFTEN, Hands::send, |hands| {
        assert!(hands.receiver.receive_timeout(PATIENCE).is_some());
    }),
    operation("wait for several with a package there", OFTEN, Hands::send, |hands| {
        hands.wait_for_both(Waiting::default())
    }),
    operation(
        "spin until a package comes",
        SLEEPS,
        |hands| hands.ask(AT_ONCE),
        |hands| assert!(hands.receiver.receive_timeout(SPIN).is_some()),
    ),
    operation(
        "spin for several until a package comes",
        SLEEPS,
        |hands| hands.ask(AT_ONCE),
        |hands| hands.wait_for_both(SPIN),
    ),
    operation(
        "sleep until a package comes",
        SLEEPS,
        |hands| hands.ask(WHEN_ASLEEP),
        |hands| drop(hands.receiver.receive()),
    ),
    operation(
        "sleep for several until a package comes",
        SLEEPS,
        |hands| hands.ask(WHEN_ASLEEP),
        |hands| hands.wait_for_both(Waiting::default()),
    ),
    operation("write a record", OFTEN, nothing, |hands| hands.streams.iter_mut().for_each(Stream::write)),
    operation("fill a record in place", OFTEN, nothing, |hands| {
        for stream in &mut hands.streams {
            let mut open = stream.writer.begin(stream.next_stamp()).unwrap();
            open.body_mut()[..40].fill(7);
            open.finish(40).unwrap();
        }
    }),
    operation("begin a record and drop it", OFTEN, nothing, |hands| {
        hands.streams.iter_mut().for_each(|stream| drop(stream.writer.begin(stream.next_stamp()).unwrap()));
    }),
    operation("write a record that is late", OFTEN, Hands::write, |hands| {
        for stream in &mut hands.streams {
            assert!(stream.writer.write(Stamp { epoch: 1, ns: 1 }, b"").is_err());
        }
    }),
    operation("copy the next record", OFTEN, Hands::write, |hands| {
        for stream in &mut hands.streams {
            while !matches!(stream.reader.try_next_into(&mut stream.copy).unwrap(), Next::Nothing) {}
        }
    }),
    operation("hold the next record", OFTEN, Hands::write, |hands| {
        for stream in &mut hands.streams {
            while !matches!(stream.reader.try_next().unwrap(), Next::Nothing) {}
        }
    }),
    operation("read the newest record", OFTEN, Hands::write, |hands| {
        for stream in &mut hands.streams {
            assert!(stream.reader.newest().unwrap().is_some_and(|record| !record.body().is_empty()));
            assert!(stream.reader.newest_into(&mut stream.copy).unwrap().is_some());
        }
    }),
    operation("look for the two around a time", OFTEN, Hands::write, |hands| {
        for stream in &mut hands.streams {
            let ns = stream.writer.written() - 1;
            let Ok(Around::Records { before, .. }) = stream.reader.around(Stamp { epoch: 1, ns }) else {
                panic!("they are there");
            };
            assert!(stream.reader.record_into(before.sequence, &mut stream.copy).is_some());
        }
    }),
    operation("wait for a record that is there", OFTEN, Hands::write, |hands| {
        for stream in &mut hands.streams {
            while !matches!(stream.reader.next_timeout(Duration::ZERO).unwrap(), Next::Nothing) {}
        }
    }),
    // So long that it is not over before the sleep begins, even on a busy computer.
    operation("sleep until a time has passed", SLEEPS, nothing, |hands| {
        assert!(hands.receiver.receive_timeout(Duration::from_millis(20)).is_none());
    }),
    operation(
        "sleep in poll until a package comes",
        SLEEPS,
        |hands| hands.ask(WHEN_ASLEEP),
        |hands| {
            hands.watches.wait_any(&mut [&mut hands.receiver], None, || false);
            hands.take();
        },
    ),
    operation("send to a receiver that sleeps", SLEEPS, |hands| hands.asleep(0), |hands| hands.wake(0)),
    operation(
        "loan and send to a receiver that sleeps",
        SLEEPS,
        |hands| hands.asleep(0),
        |hands| hands.to[0].loan(LOW).unwrap().send(&label(LOW, 1), 8).unwrap(),
    ),
    operation("send to a receiver that sleeps in poll", SLEEPS, |hands| hands.asleep(1), |hands| hands.wake(1)),
];

fn nothing(_: &mut Hands) {}

/// Does all [`OPERATIONS`] in a process of its own, in which `start` is called first, then `around` each time with the
/// index of an operation and what does it. `look` gets the process and waits for its end. In a master only.
pub(crate) fn do_all(
    ground: &Ground,
    start: impl FnOnce(),
    mut around: impl FnMut(usize, &mut dyn FnMut()),
    look: impl FnOnce(Actor),
) {
    let (board, asked) = (Board::new(1), shared());
    let others = [SLEEPER, POLLER].map(|name| Actor::new(|| receive_for_ever(ground, board, name)));
    until("they receive", || (0..2).all(|seat| board.seat(seat).is_ready()));
    let pids = others.each_ref().map(Actor::pid);
    let doer = Actor::new(|| {
        start();
        let mut hands = Hands::new(ground, board, asked, pids);
        for (at, operation) in OPERATIONS.iter().enumerate() {
            // The first time memory is touched, and tables learn of it.
            (operation.prepare)(&mut hands);
            (operation.operate)(&mut hands);
            for _ in 0..operation.times {
                (operation.prepare)(&mut hands);
                around(at, &mut || (operation.operate)(&mut hands));
            }
            hands.empty();
        }
    });
    let pid = doer.pid();
    let _answerer = Actor::new(|| answer(ground, asked, pid));
    look(doer);
}

/// A receiver that sleeps, in `poll` if it is the poller.
fn receive_for_ever(ground: &Ground, board: Board, name: Name) {
    let me = ground.join();
    let mut receiver = me.receiver(name, shape(4)).unwrap();
    let mut watches = Watches::new(&me).unwrap();
    let (_far, near) = UnixStream::pair().unwrap();
    watches.add(&near, Interest::Read).unwrap();
    let seat = board.seat(usize::from(name == POLLER));
    seat.set_ready();
    loop {
        if let Some(package) = receiver.try_receive() {
            seat.operate(|| drop(package));
        } else if name == POLLER {
            watches.wait_any(&mut [&mut receiver], None, || false);
        } else {
            wait_any(&mut [&mut receiver], None, || false);
        }
    }
}

/// Sends a package to this process whenever it asks.
fn answer(ground: &Ground, asked: &AtomicU32, pid: Pid) {
    let me = ground.join();
    until("it asks", || asked.load(SeqCst) != 0);
    let mut sender = me.sender(MAILBOX).unwrap();
    loop {
        match asked.swap(0, SeqCst) {
            0 => std::thread::yield_now(),
            when => {
                until("it sleeps", || when == AT_ONCE || is_asleep(pid));
                sender.send(&label(HIGH, 0), &[b"asked for"]).unwrap();
            }
        }
    }
}

/// All that the process has which does the operations.
struct Hands {
    board: Board,
    asked: &'static AtomicU32,
    /// Of the sleeper and the poller.
    pids: [Pid; 2],
    to: [Sender; 2],
    /// Packages that they were sent.
    sent: [u64; 2],
    receiver: Receiver,
    sender: Sender,
    /// A mailbox of two slots, of which only the newest of each state counts.
    newest: Receiver,
    newest_sender: Sender,
    /// What a router takes to another node.
    transit: Receiver,
    far_sender: Sender,
    watches: Watches,
    /// One with records that are copied while it is written, and one of plain memory.
    streams: [Stream; 2],
    _far: UnixStream,
}

/// Both ends of a stream, and what is copied from it.
struct Stream {
    writer: StreamWriter,
    reader: StreamReader,
    copy: Vec<u8>,
}

impl Stream {
    fn new(me: &Arc<Participant>, number: u16, record_bytes: u32) -> Self {
        let id = StreamId { name: MAILBOX, number };
        let writer = me.stream_writer(id, StreamShape { record_bytes, keep: 4, ..StreamShape::default() }).unwrap();
        Self { writer, reader: me.stream_reader(id).unwrap(), copy: Vec::with_capacity(record_bytes as usize) }
    }

    fn next_stamp(&self) -> Stamp {
        Stamp { epoch: 1, ns: self.writer.written() + 1 }
    }

    fn write(&mut self) {
        self.writer.write(self.next_stamp(), b"a record").unwrap();
    }
}

impl Hands {
    fn new(ground: &Ground, board: Board, asked: &'static AtomicU32, pids: [Pid; 2]) -> Self {
        let me = ground.join();
        let receiver = me.receiver(MAILBOX, shape(8)).unwrap();
        let newest = me.receiver(OTHER, Shape { full: OverflowPolicy::Latest, ..shape(2) }).unwrap();
        let mut watches = Watches::new(&me).unwrap();
        let (far, near) = UnixStream::pair().unwrap();
        watches.add(&near, Interest::Read).unwrap();
        let transit = me.receiver(TRANSIT, shape(8)).unwrap();
        me.node().set_routes(TRANSIT, &[(FAR, FAR)]).unwrap();
        let [sender, newest_sender, far_sender] = [MAILBOX, OTHER, FAR].map(|name| me.sender(name).unwrap());
        let to = [SLEEPER, POLLER].map(|name| me.sender(name).unwrap());
        let sent = [0; 2];
        Self {
            board,
            asked,
            pids,
            to,
            sent,
            receiver,
            sender,
            newest,
            newest_sender,
            transit,
            far_sender,
            watches,
            streams: [Stream::new(&me, 1, 100), Stream::new(&me, 2, 5000)],
            _far: far,
        }
    }

    fn send(&mut self) {
        self.send_as(LOW);
    }

    fn send_as(&mut self, priority: Priority) {
        self.sender.send(&label(priority, 1), &[b"a", b" body"]).unwrap();
    }

    /// Two, so that there is one before and one after.
    fn write(&mut self) {
        self.streams.iter_mut().for_each(|stream| (0..2).for_each(|_| stream.write()));
    }

    fn take(&mut self) {
        assert!(!self.receiver.try_receive().unwrap().body().is_empty());
    }

    fn empty(&mut self) {
        while self.receiver.try_receive().is_some() {}
        while self.newest.try_receive().is_some() {}
        while self.transit.try_receive().is_some() {}
    }

    /// All slots in use by packages of this priority.
    fn fill(&mut self, priority: Priority) {
        self.empty();
        (0..self.receiver.shape().slots).for_each(|_| self.send_as(priority));
    }

    fn state(&mut self, id: u16) {
        self.newest_sender.send(&label(LOW, id), &[b"state"]).unwrap();
    }

    /// These wait, and no others.
    fn states(&mut self, ids: &[u16]) {
        self.empty();
        ids.iter().for_each(|id| self.state(*id));
    }

    fn ask(&mut self, when: u32) {
        self.asked.store(when, SeqCst);
    }

    fn wait_for_both(&mut self, waiting: Waiting) {
        wait_any(&mut [&mut self.receiver, &mut self.newest], waiting, || false);
        self.take();
    }

    /// Waits until the sleeper, or the poller, has received all and sleeps.
    fn asleep(&mut self, seat: usize) {
        until("it has received all", || self.board.seat(seat).operations() == self.sent[seat]);
        until("it sleeps", || is_asleep(self.pids[seat]));
        self.sent[seat] += 1;
    }

    fn wake(&mut self, seat: usize) {
        self.to[seat].send(&label(LOW, 1), &[b"wake up"]).unwrap();
    }
}
