//! What the hot paths ask of the kernel, counted by tracing: nothing, but for one call to sleep and one to wake.

#![cfg(all(target_os = "linux", target_env = "gnu"))]
#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::board::{Board, shared};
use common::crew::{Actor, alone, is_asleep, master};
use common::{Ground, HIGH, LOW, MAILBOX, OTHER, PATIENCE, label, shape, tell, until};
use nix::sys::ptrace;
use nix::sys::signal::{Signal, raise};
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::Pid;
use rohrpost_mailbox::{
    Full, Interest, Name, Priority, Receiver, SendError, Sender, Shape, Waiting, Watches, wait_any,
};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::{Duration, Instant};

/// How often each is done; then it is done without an exception, such as the rescan that comes every so many receives.
const TIMES: u64 = 200;
const SLEEPS: u64 = 20;
const CLOCK: &str = "clock_gettime";
const NONE: &[&str] = &[];
const SLEEP: &[&str] = &["futex wait"];
const WAKE: &[&str] = &["futex wake"];
/// Who sleeps in `poll` is woken through its pipe, which its ringers open when they need it.
const WAKE_POLLER: &[&str] = &["futex wake", "openat", "write", "close"];
const SLEEP_IN_POLL: &[&str] = &["poll", "read"];

/// What is done, how often, and the system calls each time.
const OPERATIONS: &[(&str, u64, &[&str])] = &[
    ("the clock is read", TIMES, NONE),
    ("send to a receiver that is awake", TIMES, NONE),
    ("try_receive with a package waiting", TIMES, NONE),
    ("try_receive with none", TIMES, NONE),
    ("loan, fill and send", TIMES, NONE),
    ("loan and drop", TIMES, NONE),
    ("receive with a package waiting", TIMES, NONE),
    ("receive with a timeout and a package waiting", TIMES, NONE),
    ("wait for several with a package waiting", TIMES, NONE),
    ("send and displace", TIMES, NONE),
    ("send and be refused", TIMES, NONE),
    ("send what is too large", TIMES, NONE),
    ("send and replace one's own older", TIMES, NONE),
    ("send into one's own older slot", TIMES, NONE),
    ("spin until a package comes", SLEEPS, NONE),
    ("spin for several until a package comes", SLEEPS, NONE),
    ("sleep until a package comes", SLEEPS, SLEEP),
    ("sleep for several until a package comes", SLEEPS, SLEEP),
    ("sleep until a time has passed", SLEEPS, SLEEP),
    ("sleep in poll until a package comes", SLEEPS, SLEEP_IN_POLL),
    ("send to a receiver that sleeps", SLEEPS, WAKE),
    ("loan and send to a receiver that sleeps", SLEEPS, WAKE),
    ("send to a receiver that sleeps in poll", SLEEPS, WAKE_POLLER),
];

/// Marks are system calls too: questions about processes that cannot be. One before an operation, one after it.
const MARK: u64 = 0x4000_0000;
const SLEEPER: Name = Name::new(1, 202, 1, 0);
const POLLER: Name = Name::new(1, 203, 1, 0);
/// What the answerer is asked: a package at once, or when who asks sleeps.
const AT_ONCE: u32 = 1;
const WHEN_ASLEEP: u32 = 2;

#[test]
fn role() {
    let Some((_, ground)) = common::role() else { return };
    master(|| {
        let (board, asked) = (Board::new(1), shared());
        let others = [SLEEPER, POLLER].map(|name| Actor::new(|| receive_for_ever(&ground, board, name)));
        until("they receive", || (0..2).all(|seat| board.seat(seat).is_ready()));
        let pids = others.each_ref().map(Actor::pid);
        let traced = Actor::new(|| {
            ptrace::traceme().unwrap();
            raise(Signal::SIGSTOP).unwrap();
            Hands::new(&ground, board, asked, pids).do_all();
        });
        let _answerer = Actor::new(|| answer(&ground, asked, traced.pid()));
        check(&trace(traced.pid()));
        // The tracer has seen its end already.
        std::mem::forget(traced);
    });
    tell("done");
}

#[test]
fn hot_paths_ask_the_kernel_for_nothing_but_sleep_and_wake() {
    alone(&Ground::in_memory(), "trace");
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

/// Sends a package to the traced one whenever it asks.
fn answer(ground: &Ground, asked: &AtomicU32, traced: Pid) {
    let me = ground.join();
    until("it asks", || asked.load(SeqCst) != 0);
    let mut sender = me.sender(MAILBOX).unwrap();
    loop {
        match asked.swap(0, SeqCst) {
            0 => std::thread::yield_now(),
            when => {
                until("it sleeps", || when == AT_ONCE || is_asleep(traced));
                sender.send(&label(HIGH, 0), &[b"asked for"]).unwrap();
            }
        }
    }
}

/// All that the traced process has.
struct Hands {
    board: Board,
    asked: &'static AtomicU32,
    /// Of the sleeper and the poller.
    pids: [Pid; 2],
    receiver: Receiver,
    sender: Sender,
    /// A mailbox of two slots, of which only the newest counts.
    newest: Receiver,
    newest_sender: Sender,
    to: [Sender; 2],
    /// Packages that the sleeper and the poller were sent.
    sent: [u64; 2],
    watches: Watches,
    _far: UnixStream,
    operation: u64,
}

impl Hands {
    fn new(ground: &Ground, board: Board, asked: &'static AtomicU32, pids: [Pid; 2]) -> Self {
        let me = ground.join();
        let receiver = me.receiver(MAILBOX, shape(8)).unwrap();
        let newest = me.receiver(OTHER, Shape { full: Full::Latest, ..shape(2) }).unwrap();
        let mut watches = Watches::new(&me).unwrap();
        let (far, near) = UnixStream::pair().unwrap();
        watches.add(&near, Interest::Read).unwrap();
        let [sender, newest_sender] = [MAILBOX, OTHER].map(|name| me.sender(name).unwrap());
        let to = [SLEEPER, POLLER].map(|name| me.sender(name).unwrap());
        Self {
            board,
            asked,
            pids,
            receiver,
            sender,
            newest,
            newest_sender,
            to,
            sent: [0; 2],
            watches,
            _far: far,
            operation: 0,
        }
    }

    fn send(&mut self) {
        self.sender.send(&label(LOW, 1), &[b"a", b" body"]).unwrap();
    }

    fn take(&mut self) {
        assert!(!self.receiver.try_receive().unwrap().body().is_empty());
    }

    fn empty(&mut self) {
        while self.receiver.try_receive().is_some() {}
        while self.newest.try_receive().is_some() {}
    }

    /// All slots in use by packages of this priority.
    fn fill(&mut self, priority: Priority) {
        self.empty();
        for _ in 0..self.receiver.shape().slots {
            self.sender.send(&label(priority, 1), &[]).unwrap();
        }
    }

    fn mark(&self) {
        // SAFETY: takes numbers only, and changes nothing.
        assert_eq!(unsafe { libc::syscall(libc::SYS_getpgid, MARK + self.operation) }, -1);
    }

    /// The next of [`OPERATIONS`].
    fn next(&mut self, prepare: impl Fn(&mut Self), operate: impl Fn(&mut Self)) {
        for time in 0..=OPERATIONS[self.operation as usize].1 {
            prepare(self);
            // The first time memory is touched, and tables learn of it.
            if time > 0 {
                self.mark();
            }
            operate(self);
            if time > 0 {
                self.mark();
            }
        }
        self.empty();
        self.operation += 1;
    }

    fn do_all(&mut self) {
        let nothing = |_: &mut Self| {};
        self.next(nothing, |_| assert!(rohrpost_mailbox::monotonic_ns() > 0 && Instant::now().elapsed() < PATIENCE));
        self.next(Self::empty, Self::send);
        self.next(Self::send, Self::take);
        self.next(nothing, |hands| assert!(hands.receiver.try_receive().is_none()));
        self.next(Self::empty, |hands| {
            let mut loan = hands.sender.loan(LOW).unwrap();
            loan.body()[..40].fill(7);
            loan.send(&label(LOW, 1), 40).unwrap();
        });
        self.next(nothing, |hands| drop(hands.sender.loan(LOW).unwrap()));
        self.next(Self::send, |hands| drop(hands.receiver.receive()));
        self.next(Self::send, |hands| assert!(hands.receiver.receive_timeout(PATIENCE).is_some()));
        self.next(Self::send, |hands| {
            wait_any(&mut [&mut hands.receiver, &mut hands.newest], None, || false);
            hands.take();
        });
        self.next(|hands| hands.fill(LOW), |hands| hands.sender.send(&label(HIGH, 1), &[b"displaces"]).unwrap());
        self.next(
            |hands| hands.fill(HIGH),
            |hands| assert!(matches!(hands.sender.send(&label(LOW, 1), &[]), Err(SendError::Full(_)))),
        );
        self.next(nothing, |hands| assert!(hands.sender.send(&label(LOW, 1), &[&[0; 1000]]).is_err()));
        self.do_newest();
        self.do_waiting();
        self.do_waking();
        assert_eq!(self.operation as usize, OPERATIONS.len());
    }

    fn do_newest(&mut self) {
        let send = |hands: &mut Self, id| hands.newest_sender.send(&label(LOW, id), &[b"state"]).unwrap();
        self.next(|hands| (hands.empty(), send(hands, 1)).1, |hands| send(hands, 1));
        let both = |hands: &mut Self| (hands.empty(), send(hands, 1), send(hands, 2)).1;
        self.next(both, |hands| send(hands, 2));
    }

    fn do_waiting(&mut self) {
        let spin = Waiting { spin: PATIENCE, deadline: None };
        let ask = |when| move |hands: &mut Self| hands.asked.store(when, SeqCst);
        self.next(ask(AT_ONCE), |hands| drop(hands.receiver.receive_timeout(spin).unwrap()));
        self.next(ask(AT_ONCE), |hands| {
            wait_any(&mut [&mut hands.receiver, &mut hands.newest], spin, || false);
            hands.take();
        });
        self.next(ask(WHEN_ASLEEP), |hands| drop(hands.receiver.receive()));
        self.next(ask(WHEN_ASLEEP), |hands| {
            wait_any(&mut [&mut hands.receiver, &mut hands.newest], None, || false);
            hands.take();
        });
        self.next(|_| {}, |hands| assert!(hands.receiver.receive_timeout(Duration::from_millis(1)).is_none()));
        self.next(ask(WHEN_ASLEEP), |hands| {
            hands.watches.wait_any(&mut [&mut hands.receiver], None, || false);
            hands.take();
        });
    }

    fn do_waking(&mut self) {
        // It has received all so far, and sleeps.
        let asleep = |who: usize| {
            move |hands: &mut Self| {
                until("it has received all", || hands.board.seat(who).operations() == hands.sent[who]);
                until("it sleeps", || is_asleep(hands.pids[who]));
                hands.sent[who] += 1;
            }
        };
        self.next(asleep(0), |hands| hands.to[0].send(&label(LOW, 1), &[b"wake up"]).unwrap());
        self.next(asleep(0), |hands| hands.to[0].loan(LOW).unwrap().send(&label(LOW, 1), 8).unwrap());
        self.next(asleep(1), |hands| hands.to[1].send(&label(LOW, 1), &[b"wake up"]).unwrap());
    }
}

/// One time of an operation, and the system calls in it.
type Traced = (usize, Vec<String>);

/// Follows a process from its first stop to its end.
fn trace(pid: Pid) -> Vec<Traced> {
    assert_eq!(waitpid(pid, None).unwrap(), WaitStatus::Stopped(pid, Signal::SIGSTOP));
    ptrace::setoptions(pid, ptrace::Options::PTRACE_O_TRACESYSGOOD | ptrace::Options::PTRACE_O_EXITKILL).unwrap();
    let (mut all, mut inside): (Vec<Traced>, Option<Traced>) = Default::default();
    let mut signal = None;
    loop {
        ptrace::syscall(pid, signal.take()).unwrap();
        match waitpid(pid, None).unwrap() {
            WaitStatus::PtraceSyscall(_) => {}
            WaitStatus::Stopped(_, sent) => {
                signal = Some(sent);
                continue;
            }
            end => {
                assert_eq!(end, WaitStatus::Exited(pid, 0), "see above");
                return all;
            }
        }
        let Some((number, arguments)) = entered(pid) else { continue };
        // Built with debug assertions, the standard library asks whether what it closes is open.
        if cfg!(debug_assertions) && (number, arguments[1]) == (libc::SYS_fcntl, libc::F_GETFD as u64) {
            continue;
        }
        let operation = arguments[0].checked_sub(MARK).filter(|at| *at < OPERATIONS.len() as u64);
        match (operation.filter(|_| number == libc::SYS_getpgid), &mut inside) {
            (Some(at), None) => inside = Some((at as usize, Vec::new())),
            (Some(_), Some(_)) => all.extend(inside.take()),
            (None, Some((_, calls))) => calls.push(name(number, arguments)),
            (None, None) => {}
        }
    }
}

/// The system call that it is about to make; none when it comes back from one.
fn entered(pid: Pid) -> Option<(libc::c_long, [u64; 6])> {
    let info = ptrace::syscall_info(pid).unwrap();
    // SAFETY: the kernel says that it filled this one.
    let entry = (info.op == libc::PTRACE_SYSCALL_INFO_ENTRY).then(|| unsafe { info.u.entry })?;
    Some((entry.nr as libc::c_long, entry.args))
}

fn name(number: libc::c_long, arguments: [u64; 6]) -> String {
    match number {
        libc::SYS_futex => match arguments[1] as i32 & !libc::FUTEX_PRIVATE_FLAG {
            libc::FUTEX_WAIT => "futex wait".into(),
            libc::FUTEX_WAKE => "futex wake".into(),
            other => format!("futex {other}"),
        },
        #[cfg(target_arch = "x86_64")]
        libc::SYS_poll => "poll".into(),
        libc::SYS_ppoll => "poll".into(),
        libc::SYS_openat => "openat".into(),
        libc::SYS_read => "read".into(),
        libc::SYS_write => "write".into(),
        libc::SYS_close => "close".into(),
        libc::SYS_clock_gettime => CLOCK.into(),
        other => format!("system call {other}"),
    }
}

fn check(all: &[Traced]) {
    // On a machine whose clock source cannot be read without the kernel, every look at the clock is a call: not ours to mend.
    let slow_clock = all.iter().any(|(at, calls)| *at == 0 && calls.iter().any(|call| call == CLOCK));
    if slow_clock {
        tell(
            "the kernel is asked for each look at the clock here (see .../clocksource0/current_clocksource); not counted",
        );
    }
    for (at, (what, times, expected)) in OPERATIONS.iter().enumerate() {
        let here: Vec<_> = all.iter().filter(|(operation, _)| *operation == at).collect();
        assert_eq!(here.len() as u64, *times, "{what}");
        for (time, (_, calls)) in here.into_iter().enumerate() {
            let calls: Vec<&str> =
                calls.iter().map(String::as_str).filter(|call| !slow_clock || *call != CLOCK).collect();
            assert_eq!(calls, *expected, "{what}, time {time}");
        }
    }
}
