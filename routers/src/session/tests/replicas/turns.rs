//! Parts beside packages: what comes is read when all that was due has left, and a part is no more than it is.

use crate::harness::MS;
use crate::session::ClientIndex;
use crate::session::frame::{LENGTH_MAX, SessionFrameHead, SessionFrameKind};
use crate::session::server::ServerStep;
use crate::session::tests::ground::{Ground, package};
use crate::session::tests::plan::module;
use crate::session::tests::world::rings::Rings;
use rohrpost_mailbox::{Head, Priority, Type};

/// What is read of a client at a time.
const PIECE_BYTES: usize = 64 * 1024;
/// When modules write both streams, and when poses only.
const BOTH_MS: u64 = 0;
const POSES_MS: u64 = 10;

impl Ground {
    fn rings(&mut self) -> &mut Rings {
        self.said.rings.as_mut().unwrap()
    }

    /// One piece of packages from a client to another comes at once.
    fn reads_piece(&mut self, (from, to): (usize, usize)) -> usize {
        let (to, sender, kind) = (module(to), module(from).with_local(1), Type::data(1));
        let head = Head { to, from: sender, len: 1000, kind, priority: Priority(60), ..Head::default() };
        let one = package(head, &[0; 1000]).to_bytes();
        let count = (PIECE_BYTES - 2000).div_ceil(one.len());
        let place = self.ends[from].1.unwrap();
        self.server.received(self.now_ns, place, &one.repeat(count), &mut self.said);
        count
    }

    /// All streams take all, until a step that is no writing; clients to which something was written, and whether more
    /// waited.
    fn writes(&mut self) -> (ServerStep, Vec<(ClientIndex, bool)>) {
        let mut written = Vec::new();
        loop {
            let step = self.server.poll(self.now_ns, &mut self.said);
            let ServerStep::Write(index) = step else { return (step, written) };
            written.push((index, self.server.has_waiting(index)));
            let bytes = self.server.ready(index).len();
            self.server.took(self.now_ns, index, bytes);
        }
    }
}

#[test]
fn what_comes_is_read_when_all_packages_that_wait_have_left_however_many_parts_do() {
    let mut ground = Ground::replicated(3);
    let others = [0, 2].map(|client| ground.ends[client].1.unwrap());
    let (mut looks, mut packages) = (0, 0);
    while looks < 40 {
        ground.rings().write(BOTH_MS);
        ground.now_ns += MS;
        packages += ground.reads_piece((0, 1));
        let (step, written) = ground.writes();
        assert_eq!(ground.server.waiting(), 0, "before something is read again, all has left");
        for client in others {
            let parts = written.iter().filter(|(index, _)| *index == client).count();
            assert!(parts <= 1, "{parts} parts for {client:?} before something is read");
        }
        looks += usize::from(step == ServerStep::Look);
    }
    let class = ground.server.counts().class(Priority(60));
    assert_eq!((class.packages.get(), class.passed.get()), (packages as u64, packages as u64), "none was lost");
}

/// What is written whenever there is more counts as the most that a line takes.
#[test]
fn poses_alone_are_no_more_than_they_are() {
    let mut ground = Ground::replicated(3);
    ground.rings().write(POSES_MS);
    // The descriptions leave, and the first poses.
    while ground.writes().0 == ServerStep::Look {}
    for _ in 0..20 {
        ground.now_ns += MS;
        ground.rings().write(POSES_MS);
        let (step, written) = ground.writes();
        assert_eq!((step == ServerStep::Look, written.len()), (false, 3), "one to each client");
        assert!(written.iter().all(|(_, more)| !more), "{written:?}");
    }
}

impl Ground {
    /// Whether what leaves next to a client is a part; then its stream is full for a moment.
    fn sends_part(&mut self, client: usize) -> bool {
        let place = self.ends[client].1.unwrap();
        loop {
            let ServerStep::Write(index) = self.server.poll(self.now_ns, &mut self.said) else { continue };
            let ready = self.server.ready(index);
            let (first, bytes) = (ready.first_chunk().copied(), ready.len());
            let Some(first) = first.filter(|_| index == place) else {
                self.server.took(self.now_ns, index, bytes);
                continue;
            };
            self.server.took(self.now_ns, index, bytes - 1);
            self.writes();
            self.server.took(self.now_ns, place, 1);
            let head = SessionFrameHead::parse(&first, LENGTH_MAX).unwrap();
            return head.kind == SessionFrameKind::RecordPart;
        }
    }
}

/// Poses are more important than these.
#[test]
fn while_less_important_packages_wait_parts_and_batches_of_them_have_turns() {
    let mut ground = Ground::replicated(3);
    ground.rings().write(POSES_MS);
    while ground.writes().0 == ServerStep::Look {}
    ground.reads_piece((0, 1));
    ground.now_ns += MS;
    let mut kinds = Vec::new();
    for _ in 0..4 {
        ground.rings().write(POSES_MS);
        kinds.push(ground.sends_part(1));
    }
    assert_eq!(kinds.iter().filter(|is_part| **is_part).count(), 2, "in turn: {kinds:?}");
}
