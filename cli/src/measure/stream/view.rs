//! What is known of a stream, as programs read it and as people do.

use super::choice::{item_of, writer_text};
use super::stamp::stamp_text;
use crate::look::target::Running;
use crate::terminal::table::{table_of, time};
use crate::terminal::units::{bytes, short};
use rohrpost::Name;
use rohrpost_config::Installation;
use rohrpost_launch::survey::StreamSurvey;
use rohrpost_mailbox::{Missed, RecordInfo, StreamId};
use serde::Serialize;
use std::time::Duration;

#[derive(Serialize)]
pub(crate) struct StreamView {
    node: String,
    #[serde(skip)]
    id: StreamId,
    stream: String,
    number: u16,
    /// Its name; none without a description of its module on the node that the tool runs on.
    item: Option<String>,
    record_bytes: u32,
    keep: u32,
    late_s: f64,
    /// Size of its shared memory.
    memory_bytes: usize,
    /// The node on which it is written, if this is a replica.
    origin: Option<String>,
    /// The present writer, or the last one; of a replica the router that writes it here.
    writer: Option<WriterView>,
    adoptions: u32,
    written: u64,
    refused: u64,
    oldest: Option<RecordView>,
    newest: Option<RecordView>,
    readers: u16,
    readers_max: u16,
    holding: u16,
    sleeping: u16,
    missed: MissedView,
}

/// Records that were not read, by cause.
#[derive(Serialize)]
pub(super) struct MissedView {
    lost: u64,
    sampled: u64,
    passed_over: u64,
}

impl From<Missed> for MissedView {
    fn from(Missed { lost, sampled, passed_over }: Missed) -> Self {
        Self { lost, sampled, passed_over }
    }
}

#[derive(Serialize)]
struct WriterView {
    module: Option<String>,
    pid: Option<u32>,
    alive: bool,
}

/// A record without its bytes.
#[derive(Serialize)]
pub(super) struct RecordView {
    sequence: u64,
    stamp_ns: u64,
    epoch: u64,
    len_bytes: usize,
    /// Time since it was written.
    age_s: f64,
}

impl RecordView {
    /// At this time of the monotonic clock.
    pub(super) fn new(record: &RecordInfo, now_ns: u64) -> Self {
        Self {
            sequence: record.sequence,
            stamp_ns: record.stamp.ns,
            epoch: record.stamp.epoch,
            len_bytes: record.len_bytes,
            age_s: Duration::from_nanos(now_ns.saturating_sub(record.written_ns)).as_secs_f64(),
        }
    }

    fn text(&self) -> String {
        let Self { sequence, epoch, len_bytes, .. } = self;
        let (stamp, age) = (stamp_text(self.stamp_ns), short(self.age_s));
        format!("#{sequence}, stamp {stamp} of epoch {epoch}, {len_bytes} B, written {age} ago")
    }
}

impl StreamView {
    /// `item` is the name of the stream; `name` writes names of modules as people read them.
    pub(super) fn new(seen: &StreamSurvey, item: Option<String>, name: impl Fn(Name) -> String) -> Self {
        let StreamSurvey { node, at_ns, info } = seen;
        let shape = &info.shape;
        let record = |record: &RecordInfo| RecordView::new(record, *at_ns);
        Self {
            node: node.clone(),
            id: info.id,
            stream: name(info.id.name),
            number: info.id.number,
            item,
            record_bytes: shape.record_bytes,
            keep: shape.keep,
            late_s: shape.late.as_secs_f64(),
            memory_bytes: shape.segment_bytes(),
            origin: None,
            writer: info.writer.as_ref().map(|writer| WriterView {
                module: (writer.module != Name::NONE).then(|| name(writer.module)),
                pid: writer.pid,
                alive: writer.is_alive,
            }),
            adoptions: info.adoptions,
            written: info.written,
            refused: info.refused,
            oldest: info.oldest.as_ref().map(record),
            newest: info.newest.as_ref().map(record),
            readers: info.readers,
            readers_max: shape.readers,
            holding: info.holding,
            sleeping: info.sleeping,
            missed: info.missed.into(),
        }
    }

    /// The same as a part of this installation: it tells which streams are replicas.
    pub(super) fn of(self, installation: &Installation) -> Self {
        let origin = installation.node_of(self.id.name).filter(|node| *node != self.node).map(Into::into);
        Self { origin, ..self }
    }

    fn written_by(&self, writer: &WriterView) -> String {
        match &self.origin {
            Some(node) => format!("the router, from node {node}"),
            None => writer_text(writer.module.as_deref(), writer.pid),
        }
    }
}

/// Streams as people and programs read them.
pub(crate) fn stream_views(installation: &Installation, streams: &[StreamSurvey]) -> Vec<StreamView> {
    let view = |seen: &StreamSurvey| StreamView::new(seen, None, |name| installation.classes.format(name));
    streams.iter().map(|seen| view(seen).of(installation)).collect()
}

/// Names the streams of the node that the tool runs on, where descriptions of their modules tell the names.
pub(crate) fn name_items(running: &Running, streams: &mut [StreamView]) {
    for stream in streams.iter_mut().filter(|stream| stream.node == running.node_name) {
        stream.item = item_of(running, stream.id).map(|item| item.field.name);
    }
}

/// Streams, one a line; those of several nodes each with its node.
pub(crate) fn print_streams(streams: &[StreamView], several: bool) -> String {
    let heads = [
        "node", "stream", "item", ">number", ">records", ">readers", "writer", ">written", ">refused", ">newest",
        ">memory",
    ];
    let first = usize::from(!several);
    let rows = streams.iter().map(|stream| {
        let row = [
            stream.node.clone(),
            stream.stream.clone(),
            stream.item.clone().unwrap_or_else(|| "-".into()),
            stream.number.to_string(),
            format!("{} x {} B", stream.keep, stream.record_bytes),
            format!("{} of {}", stream.readers, stream.readers_max),
            stream.writer.as_ref().filter(|it| it.alive).map_or("nobody".into(), |it| stream.written_by(it)),
            stream.written.to_string(),
            stream.refused.to_string(),
            stream.newest.as_ref().map_or("none".into(), |newest| format!("{} ago", short(newest.age_s))),
            bytes(stream.memory_bytes as f64),
        ];
        row[first..].to_vec()
    });
    table_of(&heads[first..], rows)
}

pub(super) fn print_stream(stream: &StreamView) -> String {
    let writer = match &stream.writer {
        None => "nobody yet".into(),
        Some(writer) if writer.alive => stream.written_by(writer),
        Some(writer) => format!("nobody; the last was {}", stream.written_by(writer)),
    };
    let late = match Duration::try_from_secs_f64(stream.late_s).unwrap_or_default() {
        Duration::ZERO => "a stamp behind the newest is refused".into(),
        late => format!("a stamp may be {} behind the newest", time(late)),
    };
    let record = |record: &Option<RecordView>| record.as_ref().map_or("none".into(), RecordView::text);
    let readers = format!(
        "{} of {} seats in use; {} hold a record, {} sleep",
        stream.readers, stream.readers_max, stream.holding, stream.sleeping
    );
    let MissedView { lost, sampled, passed_over } = stream.missed;
    let facts = [
        ("writer", writer),
        ("readers", readers),
        ("keeps", format!("{} records of at most {} B", stream.keep, stream.record_bytes)),
        ("memory", format!("{} B", stream.memory_bytes)),
        ("late", late),
        ("written", stream.written.to_string()),
        ("refused", stream.refused.to_string()),
        (
            "missed",
            format!(
                "{lost} lost on the way, {sampled} left out by sampling, {passed_over} passed over by present readers"
            ),
        ),
        ("newest", record(&stream.newest)),
        ("oldest", record(&stream.oldest)),
        ("adoptions", stream.adoptions.to_string()),
    ];
    let facts: String = facts.iter().map(|(what, text)| format!("\n  {what:10}  {text}")).collect();
    let item = stream.item.as_ref().map_or(String::new(), |item| format!(", {item}"));
    format!("stream {} {}{item}, node {}\n{facts}", stream.stream, stream.number, stream.node)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::{Party, Stamp, StreamInfo, StreamShape};

    const NOW_NS: u64 = 5_000_000_000;

    fn record(sequence: u64, age: Duration) -> Option<RecordInfo> {
        let stamp = Stamp { epoch: 2, ns: 1_700_000_000_000_000_007 };
        let written_ns = NOW_NS - age.as_nanos() as u64;
        Some(RecordInfo { sequence, stamp, written_ns, len_bytes: 512, incarnation: 9 })
    }

    fn info(is_alive: bool) -> StreamInfo {
        let module = Name::new(1, 96, 0, 0);
        StreamInfo {
            id: StreamId { name: module, number: 7 },
            shape: StreamShape { late: Duration::from_millis(50), ..StreamShape::default() },
            writer: Some(Party { participant: 3, pid: Some(4711), module, is_alive }),
            adoptions: 1,
            written: 100,
            refused: 2,
            oldest: record(36, Duration::from_secs(2)),
            newest: record(99, Duration::from_millis(30)),
            readers: 2,
            reader_modules: Vec::new(),
            holding: 1,
            sleeping: 1,
            missed: Missed { lost: 3, sampled: 4, passed_over: 5 },
        }
    }

    fn view(info: &StreamInfo) -> StreamView {
        let seen = StreamSurvey { node: "main".into(), at_ns: NOW_NS, info: info.clone() };
        let item = (info.id.number == 7).then(|| "image".into());
        StreamView::new(&seen, item, |_| "camera.0".into())
    }

    #[test]
    fn streams_are_listed_one_a_line() {
        let mut empty = StreamInfo { writer: None, written: 0, newest: None, oldest: None, readers: 0, ..info(true) };
        empty.id.number = 8;
        assert_eq!(
            print_streams(&[view(&info(true)), view(&info(false)), view(&empty)], false),
            "\
stream    item   number      records  readers  writer                  written  refused     newest    memory
camera.0  image       7  64 x 1024 B   2 of 8  camera.0, process 4711      100        2  30 ms ago  94.21 kB
camera.0  image       7  64 x 1024 B   2 of 8  nobody                      100        2  30 ms ago  94.21 kB
camera.0  -           8  64 x 1024 B   0 of 8  nobody                        0        2       none  94.21 kB
"
        );
        let several = print_streams(&[view(&empty)], true);
        assert!(several.starts_with("node  stream") && several.contains("\nmain  camera.0"), "{several}");
    }

    #[test]
    fn one_stream_is_told_with_all_that_is_known() {
        assert_eq!(
            print_stream(&view(&info(false))),
            "stream camera.0 7, image, node main

  writer      nobody; the last was camera.0, process 4711
  readers     2 of 8 seats in use; 1 hold a record, 1 sleep
  keeps       64 records of at most 1024 B
  memory      94208 B
  late        a stamp may be 50 ms behind the newest
  written     100
  refused     2
  missed      3 lost on the way, 4 left out by sampling, 5 passed over by present readers
  newest      #99, stamp 1700000000.000000007 of epoch 2, 512 B, written 30 ms ago
  oldest      #36, stamp 1700000000.000000007 of epoch 2, 512 B, written 2.0 s ago
  adoptions   1"
        );
        let strict = StreamInfo { shape: StreamShape::default(), writer: None, ..info(true) };
        let told = print_stream(&view(&strict));
        assert!(told.contains("writer      nobody yet\n"), "{told}");
        assert!(told.contains("late        a stamp behind the newest is refused\n"), "{told}");
    }
}
