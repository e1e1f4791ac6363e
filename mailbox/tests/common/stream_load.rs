//! A stream under load: a writer at full speed and readers in each way of reading, and what they write down for each
//! other. It lies in memory that forked processes share, and outlives each of them.

use super::board::{Board, shared_words};
use super::random::Random;
use super::records::Records;
use super::{MAILBOX, PATIENCE};
use rohrpost_mailbox::{
    HeldRecord, Name, Next, Node, Participant, RecordInfo, Stamp, StreamId, StreamReader, StreamShape, StreamWriter,
};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::time::Duration;

pub(crate) const STREAM: StreamId = StreamId { name: MAILBOX, number: 3 };
/// Contents of records.
const CONTENTS: usize = 61;

/// Records of these sizes and some in between.
pub(crate) fn records_between(shortest: usize, longest: usize) -> Records {
    Records::new((0..CONTENTS).map(|at| shortest + (longest - shortest) * at / (CONTENTS - 1)))
}

/// What one reader has written down.
struct Account {
    began: &'static AtomicU64,
    read: &'static AtomicU64,
    lost: &'static AtomicU64,
}

/// What all have written down.
#[derive(Clone, Copy)]
pub(crate) struct Ledger {
    /// Readers have the first seats, the writer the one behind them.
    pub(crate) board: Board,
    pub(crate) readers: usize,
    /// Records written; read by all readers that ever were; lost; then the living readers' accounts.
    words: &'static [AtomicU64],
}

impl Ledger {
    pub(crate) fn new(readers: usize) -> Self {
        Self { board: Board::new(0), readers, words: shared_words(3 + 3 * readers) }
    }

    /// The seat of the writer.
    pub(crate) fn writer(&self) -> usize {
        self.readers
    }

    pub(crate) fn written(&self) -> &'static AtomicU64 {
        &self.words[0]
    }

    pub(crate) fn all_read(&self) -> &'static AtomicU64 {
        &self.words[1]
    }

    pub(crate) fn all_lost(&self) -> &'static AtomicU64 {
        &self.words[2]
    }

    fn account(&self, seat: usize) -> Account {
        let words = &self.words[3 + 3 * seat..][..3];
        Account { began: &words[0], read: &words[1], lost: &words[2] }
    }

    /// Before a process takes a seat.
    pub(crate) fn reset(&self, seat: usize) {
        self.board.seat(seat).reset();
        if seat < self.readers {
            let Account { began, read, lost } = self.account(seat);
            [began, read, lost].into_iter().for_each(|word| word.store(0, SeqCst));
        }
    }

    /// Whether this reader accounts for all that was written, while nobody writes.
    ///
    /// # Panics
    /// When it accounts for more.
    pub(crate) fn is_at_rest(&self, seat: usize) -> bool {
        let (account, written) = (self.account(seat), self.written().load(SeqCst));
        let reached: u64 = [account.began, account.read, account.lost].iter().map(|word| word.load(SeqCst)).sum();
        assert!(reached <= written, "reader {seat} accounts for {reached} of {written} records");
        self.board.seat(seat).is_ready() && reached == written
    }

    /// A new writer has come: all that its predecessor wrote down is there, and at most one more.
    pub(crate) fn succeed(&self, writer: &StreamWriter) {
        let (noted, written) = (self.written().load(SeqCst), writer.written());
        assert!(written == noted || written == noted + 1, "{written} records are there, {noted} were written");
        self.written().store(written, SeqCst);
    }
}

fn stamp(number: u64) -> Stamp {
    Stamp { epoch: 1, ns: number + 1 }
}

/// What a writer does until it is killed.
pub(crate) struct Writing<'a> {
    pub(crate) ledger: Ledger,
    pub(crate) records: &'a Records,
    pub(crate) random: Random,
    /// Whether it rests now and then.
    pub(crate) rests: bool,
    pub(crate) body: Vec<u8>,
}

impl Writing<'_> {
    pub(crate) fn write_on(mut self, path: &Path, shape: StreamShape) {
        let seat = self.ledger.board.seat(self.ledger.writer());
        let me = Participant::join(&Node::open(path).unwrap(), Name::NONE).unwrap();
        let mut writer = seat.operate(|| me.stream_writer(STREAM, shape).unwrap());
        self.ledger.succeed(&writer);
        seat.set_ready();
        loop {
            self.ledger.board.hold_if_asked(seat);
            seat.operate(|| self.write(&mut writer));
            self.ledger.written().store(writer.written(), SeqCst);
            // Then the readers come to rest as well, and sleep.
            if self.rests && self.random.one_in(500) {
                std::thread::sleep(Duration::from_micros(200));
            }
        }
    }

    pub(crate) fn write(&mut self, writer: &mut StreamWriter) {
        let number = writer.written();
        let len = self.records.len(number);
        if self.random.one_in(2) {
            self.records.fill(number, &mut self.body);
            assert_eq!(writer.write(stamp(number), &self.body[..len]), Ok(number));
            return;
        }
        let mut open = writer.begin(stamp(number)).unwrap();
        self.records.fill(number, open.body_mut());
        if !self.random.one_in(8) {
            assert_eq!(open.finish(len), Ok(number));
        }
    }
}

/// What a reader does until it is killed.
pub(crate) struct Reading<'a> {
    pub(crate) ledger: Ledger,
    pub(crate) records: &'a Records,
    pub(crate) random: Random,
    /// Whether it rests now and then.
    pub(crate) rests: bool,
    pub(crate) seat: usize,
    pub(crate) copy: Vec<u8>,
}

impl Reading<'_> {
    pub(crate) fn read_on(mut self, path: &Path) {
        let (seat, account) = (self.ledger.board.seat(self.seat), self.ledger.account(self.seat));
        let me = Participant::join(&Node::open(path).unwrap(), Name::NONE).unwrap();
        let mut reader = seat.operate(|| me.stream_reader(STREAM).unwrap());
        let began = reader.position();
        account.began.store(began, SeqCst);
        seat.set_ready();
        loop {
            seat.operate(|| self.read(&mut reader));
            let (read, lost) = reader.accounts();
            assert_eq!(reader.position() - began, read + lost, "the account is not exact");
            account.read.store(read, SeqCst);
            account.lost.store(lost, SeqCst);
            if self.random.one_in(16) {
                self.look(&mut reader);
            }
            if self.rests && self.random.one_in(200) {
                std::thread::sleep(Duration::from_micros(100));
            }
        }
    }

    /// The next record in this reader's way: held or copied, waiting asleep or not.
    pub(crate) fn read(&mut self, reader: &mut StreamReader) {
        let (position, records) = (reader.position(), self.records);
        let next = match self.seat % 4 {
            0 => reader.try_next().unwrap().map(|record| self.check(&record)),
            1 => reader.next_timeout(PATIENCE).unwrap().map(|record| self.check(&record)),
            way => {
                let copied = match way {
                    2 => reader.try_next_into(&mut self.copy).unwrap(),
                    _ => reader.next_timeout_into(&mut self.copy, PATIENCE).unwrap(),
                };
                copied.map(|info| {
                    check(records, &info, &self.copy);
                    info
                })
            }
        };
        match next {
            Next::Record(info) => {
                assert_eq!(info.sequence, position, "out of order");
                self.ledger.all_read().fetch_add(1, SeqCst);
            }
            Next::Lost(lost) => {
                assert_eq!(reader.position(), position + lost);
                self.ledger.all_lost().fetch_add(lost, SeqCst);
            }
            Next::Nothing => std::thread::yield_now(),
        }
    }

    /// Also when the writer has turned the ring meanwhile.
    fn check(&mut self, record: &HeldRecord<'_>) -> RecordInfo {
        check(self.records, &record.info(), record.body());
        if self.random.one_in(8) {
            std::thread::yield_now();
            check(self.records, &record.info(), record.body());
        }
        record.info()
    }

    /// Besides, and without effect on the account.
    fn look(&mut self, reader: &mut StreamReader) {
        if let Some(record) = reader.newest().unwrap() {
            check(self.records, &record.info(), record.body());
        }
        let sequence = reader.position().saturating_sub(self.random.below(4));
        if let Some(info) = reader.record_into(sequence, &mut self.copy) {
            assert_eq!(info.sequence, sequence);
            check(self.records, &info, &self.copy);
        }
    }
}

fn check(records: &Records, info: &RecordInfo, body: &[u8]) {
    records.check(info.sequence, body);
    assert_eq!(info.stamp, stamp(info.sequence));
}
