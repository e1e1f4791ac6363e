//! The modules that write streams and read replicas: some die, come back, describe themselves anew, or make their
//! stream anew; some read slowly, or begin late.

use super::NodeTime;
use super::books::{WrittenRecord, body, start_of};
use super::streams::{ReplicaReader, Streams};
use crate::sim::promise::Promise;
use crate::sim::spans::{MS, US};
use crate::sim::world::{Event, World};
use rohrpost_mailbox::{Next, OriginRecord, RecordInfo, Stamp};

/// Records that may be on their way, or that are taken for others, at a moment.
const ON_THE_WAY: u64 = 64;
/// Of a reader that looks, so many records are read at a time at most.
const READ_MAX: u64 = 64;

impl World<'_> {
    pub(in crate::sim) fn write(&mut self, stream: usize) {
        let its = self.plan.streams[stream].clone();
        if self.now_ns >= self.plan.traffic_end_ns {
            return;
        }
        let next_ns = its.period_ns * self.chance.between(90, 110) / 100;
        self.at(self.now_ns + next_ns.max(1), Event::Write { stream });
        if self.stations[its.node].asleep > 0 {
            return;
        }
        if self.now_ns < self.plan.fixed_ns && self.writer_fails(stream) {
            return;
        }
        if !self.streams.editions.contains_key(&its.id.name) {
            self.streams.describe(its.node, its.id.name);
        }
        let rings = self.streams.rings.clone();
        if self.streams.writers[stream].is_none() {
            let writer = rings.join(its.node).stream_writer(its.id, its.shape);
            self.streams.writers[stream] = Some(writer.expect("nobody else writes it"));
        }
        let Some(writer) = &mut self.streams.writers[stream] else { return };
        let now = self.stations[its.node].clock.at(self.now_ns);
        let time = NodeTime::by(self.oracle.times.page(now, its.node), now).at(now.monotonic_ns);
        let stamp = Stamp { epoch: time.epoch, ns: time.ns };
        let before = self.oracle.records.newest(stream).filter(|_| self.chance.percent(its.same_percent));
        let (start, len) = match before {
            Some((_, before)) => (before.start, before.len),
            None => {
                let len = self.chance.between(its.bytes.0, its.bytes.1) as usize;
                // The incarnation is told with the first record.
                let incarnation = writer.newest().map_or(0, |(newest, _)| newest.incarnation);
                (start_of(stream, incarnation, writer.written(), len), len)
            }
        };
        let Ok(sequence) = writer.write(stamp, body(start, len)) else { return self.oracle.saw("a record refused") };
        let Some((info, _)) = writer.newest() else { return };
        rings.note_moment(info.written_ns, now.monotonic_ns);
        let generation = self.oracle.records.streams[stream].generation;
        let record = WrittenRecord { generation, stamp, len, start, at_ns: self.now_ns };
        self.oracle.records.note(stream, (info.incarnation, sequence), record);
        self.oracle.saw("a record written");
        self.trace.line(self.now_ns, || format!("{} writes record {sequence} of {}: {info:?}", its.node, its.id));
        if self.stations[its.node].runs() {
            let late_ns = self.chance.between(US, 60 * US);
            self.wake_at(its.node, self.now_ns + late_ns);
        }
    }

    /// What goes wrong with a module that writes; whether it writes nothing this time.
    fn writer_fails(&mut self, stream: usize) -> bool {
        let its = &self.plan.streams[stream];
        let (node, id) = (its.node, its.id);
        let book = &mut self.oracle.records.streams[stream];
        match self.chance.below(1000) {
            0..15 => {
                self.streams.writers[stream] = None;
                self.oracle.saw("a writer restarts");
                true
            }
            15..18 => {
                self.streams.writers[stream] = None;
                let removed = self.streams.rings.node(node).remove_orphan_stream(id);
                if removed.is_ok_and(|removed| removed) {
                    (book.generation, book.changes) = (book.generation + 1, book.changes + 1);
                    self.oracle.saw("a stream made anew");
                    self.trace.line(self.now_ns, || format!("{node} makes {id} anew"));
                }
                true
            }
            18..22 => {
                self.streams.describe(node, id.name);
                let all = self.plan.streams.iter().zip(&mut self.oracle.records.streams);
                all.filter(|(other, _)| other.id.name == id.name).for_each(|(_, book)| book.changes += 1);
                self.oracle.saw("a module described anew");
                false
            }
            _ => false,
        }
    }

    /// A reader looks what there is.
    pub(in crate::sim) fn read(&mut self, reader: usize) {
        let its = &self.streams.readers[reader];
        let (node, every_ns, id) = (its.node, its.every_ns, self.plan.streams[its.stream].id);
        let next_ns = every_ns * self.chance.between(50, 150) / 100;
        self.at(self.now_ns + next_ns.max(1), Event::Read { reader });
        if self.stations[node].asleep > 0 {
            return;
        }
        let its = &mut self.streams.readers[reader];
        if its.seat.is_some() && self.now_ns < self.plan.fixed_ns && self.chance.below(200) == 0 {
            // It ends, and another one begins.
            (its.seat, its.last, its.again, its.accounts) = (None, None, 0, (0, 0));
            return;
        }
        if its.seat.is_none() {
            let seat = self.streams.rings.join(node).stream_reader(id);
            its.seat = Some(seat.expect("there is a seat"));
        }
        for _ in 0..self.chance.between(1, READ_MAX) {
            if !self.read_next(reader) {
                return;
            }
        }
    }

    /// Whether there may be more.
    fn read_next(&mut self, reader: usize) -> bool {
        let now = self.now(self.streams.readers[reader].node);
        let copies = self.chance.percent(50);
        let Streams { readers, body, .. } = &mut self.streams;
        let ReplicaReader { stream, node, seat, last, again, accounts, .. } = &mut readers[reader];
        let Some(seat) = seat else { return false };
        let next = if copies {
            seat.try_next_into(body)
        } else {
            seat.try_next().map(|next| {
                next.map(|record| {
                    body.clear();
                    body.extend_from_slice(record.body());
                    record.info()
                })
            })
        };
        let (oracle, plan) = (&mut self.oracle, &self.plan);
        match next {
            Ok(Next::Nothing) => return false,
            Ok(Next::Lost(lost)) => {
                accounts.1 += lost;
                oracle.saw("a reader is told of lost records");
            }
            Ok(Next::Record(info)) => {
                accounts.0 += 1;
                oracle.saw("a record read");
                match oracle.records.find(*stream, &says(&info), (0, body)) {
                    Err(text) => oracle.broken(now, Promise::Records, format!("a reader on node {node} gets: {text}")),
                    Ok(record) => {
                        let (this, changes) =
                            ((record.generation, info.sequence), oracle.records.streams[*stream].changes);
                        // A module that describes itself anew may be another one: the record that was sent last, and
                        // goes again to a node that begins, is read by its new description.
                        if *last == Some(this) && *again < changes {
                            *again += 1;
                            oracle.saw("a record read again, described anew");
                        } else if *last >= Some(this) {
                            let text =
                                format!("after {last:?} a reader on node {node} gets {this:?} of stream {stream}");
                            oracle.broken(now, Promise::RecordOrder, text);
                        }
                        *last = Some(this);
                        oracle.slowest_record_ns = oracle.slowest_record_ns.max(now.true_ns - record.at_ns);
                    }
                }
            }
            Err(error) => {
                oracle.broken(now, Promise::Records, format!("a reader on node {node} cannot read: {error}"));
            }
        }
        // Each that it missed has one cause, as soon as it is known; and sampled is only what is to be.
        let (missed, is_sampled) = (seat.missed(), plan.streams[*stream].is_sampled());
        if seat.accounts() != *accounts || missed.all() > accounts.1 || missed.sampled > 0 && !is_sampled {
            let text =
                format!("a reader on node {node} had {accounts:?}, and is told {:?}, {missed:?}", seat.accounts());
            oracle.broken(now, Promise::RecordAccounts, text);
        }
        true
    }

    /// At the end each reader has the newest record that its node has.
    pub(in crate::sim) fn close_readers(&mut self) {
        for reader in 0..self.streams.readers() {
            while self.read_next(reader) && self.oracle.problems.is_empty() {}
        }
    }

    /// What one end counts as sent the other counts as come.
    pub(in crate::sim) fn close_records(&mut self) {
        let now = self.now(0);
        let books = &self.oracle.records;
        let both = |(key, sent): (&(u16, u8), &u64)| Some((*key, *sent, *books.came.get(key)?));
        let wrong: Vec<_> = books.sent.iter().filter_map(both).collect();
        for ((place, to), sent, came) in wrong {
            if came < sent || came > sent + ON_THE_WAY {
                let text = format!("{sent} records of stream {place} were sent to node {to}, and {came} came whole");
                self.oracle.broken(now, Promise::RecordAccounts, text);
            }
        }
    }

    pub(in crate::sim) fn schedule_streams(&mut self) {
        let plan = self.plan.clone();
        for (stream, its) in plan.streams.iter().enumerate() {
            let at_ns = plan.traffic_begin_ns + self.chance.below(its.period_ns.max(100 * MS));
            self.at(at_ns, Event::Write { stream });
        }
        for reader in 0..self.streams.readers() {
            let at_ns = self.chance.below(plan.fixed_ns);
            self.at(at_ns, Event::Read { reader });
        }
    }
}

/// What is said of a record that was read.
fn says(info: &RecordInfo) -> OriginRecord {
    let RecordInfo { sequence, incarnation, stamp, len_bytes, .. } = *info;
    OriginRecord { sequence, incarnation, stamp, len_bytes }
}
