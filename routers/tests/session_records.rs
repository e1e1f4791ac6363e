//! Parts of records as a session carries them, and what becomes of them: `tests/conformance/records.json`, by which
//! clients in other languages are tested. Frames are written, and records put together, by the code of nodes;
//! `UPDATE_GOLDEN=1` writes the file anew.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Sampling;
use rohrpost_mailbox::{Name, Next, Node, Participant, StreamId, StreamReader, StreamShape, SystemTime};
use rohrpost_routers::frame::{DescriptionPart, NodeIndex, RecordPart, ReplicaFrame};
use rohrpost_routers::replication::{LINE_PART_BYTES, LineReplicas, LineSettings, ReplicaLoss, ReplicaSettings};
use rohrpost_routers::session::frame::{SessionFrameHead, SessionMessage};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

const FILE: &str = "../tests/conformance/records.json";
const PAGE: &str = include_str!("../../docs/src/wire.md");
const ID: StreamId = StreamId { name: Name::new(1, 112, 0, 0), number: 2 };
const RECORD_BYTES: u32 = 10_000;
const PLACE: u16 = 0;
const SERVER: NodeIndex = 0;
const LAPTOP: NodeIndex = 1;
const SECOND: u64 = 1_000_000_000;
const STAMP_NS: u64 = 1_700_000_000_000_000_000;

/// The description of the page, which has a stream `steps`.
fn description() -> Vec<u8> {
    let text = PAGE.split("\n```hex description\n").nth(1).unwrap().split("\n```").next().unwrap();
    let pairs = text.lines().flat_map(|line| line.split("  ").next().unwrap_or_default().as_bytes().chunks(2));
    pairs.map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

/// One case: a laptop that gets frames, and what it has then.
struct Case {
    what: &'static str,
    laptop: LineReplicas,
    reader: Option<StreamReader>,
    participant: Arc<Participant>,
    _folder: tempfile::TempDir,
    server: u64,
    generation: u16,
    steps: Vec<String>,
    records: Vec<String>,
    now_ns: u64,
}

impl Case {
    /// One that knows the description already.
    fn described(what: &'static str) -> Self {
        let mut case = Self::new(what);
        case.describe(usize::MAX);
        case
    }

    fn new(what: &'static str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("laptop"), 0o700).unwrap();
        let shape = StreamShape { record_bytes: RECORD_BYTES, keep: 16, readers: 2, late: Duration::ZERO };
        let replica = |to| ReplicaSettings {
            from: ID.name,
            item: "steps".into(),
            stream: "camera.0/steps".into(),
            shape,
            node: SERVER,
            to,
            sampling: Sampling::Each,
            changed: false,
            delay_alarm_ns: SECOND,
            deadline_ns: SECOND,
            level: 18,
        };
        let settings = LineSettings {
            own: LAPTOP,
            server: SERVER,
            nodes: Vec::new(),
            sent: vec![replica(0)],
            received: vec![replica(1 << LAPTOP)],
        };
        let time = |ns| SystemTime { ns, epoch: 1, error: Duration::ZERO, age: Duration::ZERO };
        let participant = Participant::join(&node, Name::NONE).unwrap();
        let laptop = LineReplicas::new(
            &settings,
            participant.clone(),
            Arc::new(|_: &[u8], _: &str| Some(ID.number)),
            Box::new(time),
        );
        Self {
            what,
            laptop,
            reader: None,
            participant,
            _folder: folder,
            server: 1,
            generation: 0,
            steps: Vec::new(),
            records: Vec::new(),
            now_ns: 10 * SECOND,
        }
    }

    fn feed(&mut self, message: &SessionMessage<'_>) {
        let bytes = message.to_bytes();
        self.steps.push(format!("{{\"frame\": \"{}\", \"server\": {}}}", hex(&bytes), self.server));
        let (head, rest) = bytes.split_first_chunk().unwrap();
        let head = SessionFrameHead::parse(head, rest.len()).unwrap();
        let frame = match SessionMessage::parse(head, rest).unwrap() {
            SessionMessage::Record(part) => ReplicaFrame::Record(part),
            SessionMessage::Description(part) => ReplicaFrame::Description(part),
            other => panic!("{other:?}"),
        };
        // Rings are made anew once a second at most.
        self.now_ns += 2 * SECOND;
        self.laptop.take(self.now_ns, (Some(SERVER), self.server), &frame);
        self.read();
    }

    /// What is there by now.
    fn read(&mut self) {
        if self.reader.is_none() {
            // Before the first record there is no ring.
            if self.participant.node().inspect_stream(ID).ok().flatten().is_none() {
                return;
            }
            let mut reader = self.participant.stream_reader(ID).unwrap();
            let oldest = self.participant.node().inspect_stream(ID).unwrap().unwrap().oldest;
            reader.seek(oldest.map_or(0, |oldest| oldest.sequence));
            self.reader = Some(reader);
        }
        let Some(reader) = &mut self.reader else { return };
        for _ in 0..100 {
            if let Next::Record(record) = reader.try_next().unwrap() {
                let (info, body) = (record.info(), record.body());
                self.records.push(format!(
                    "[{}, {}, {}, {}, {}, {}]",
                    info.sequence,
                    info.incarnation,
                    info.stamp.epoch,
                    info.stamp.ns,
                    body.len(),
                    crc32fast::hash(body)
                ));
            }
        }
    }

    /// The description, in parts of so many bytes.
    fn describe(&mut self, part_bytes: usize) {
        let (words, mut offset) = (description(), 0);
        for bytes in words.chunks(part_bytes.min(words.len())) {
            let part = DescriptionPart {
                place: PLACE,
                generation: self.generation,
                check: crc32fast::hash(&words),
                len: words.len() as u32,
                offset,
                written: 0,
                bytes,
            };
            self.feed(&SessionMessage::Description(part));
            offset += bytes.len() as u32;
        }
    }

    /// Parts of a record of so many bytes, as `change` makes them.
    fn parts(&mut self, sequence: u64, len: usize, change: impl Fn(usize, &mut RecordPart<'_>)) {
        let body: Vec<u8> = (0..len).map(|at| (at as u64 * 7 + sequence) as u8).collect();
        let check = crc32fast::hash(&description());
        for at in 0..len.div_ceil(LINE_PART_BYTES).max(1) {
            let offset = at * LINE_PART_BYTES;
            let mut part = RecordPart {
                place: PLACE,
                generation: self.generation,
                description: check,
                incarnation: 77,
                len: len as u32,
                offset: offset as u32,
                sequence,
                epoch: 1,
                stamp_ns: STAMP_NS + sequence,
                written_ns: STAMP_NS + sequence,
                error_ns: 2500,
                step: 0,
                sampled: 0,
                bytes: &body[offset..len.min(offset + LINE_PART_BYTES)],
            };
            change(at, &mut part);
            if part.place == PLACE {
                self.feed(&SessionMessage::Record(part));
            }
        }
    }

    fn record(&mut self, sequence: u64, len: usize) {
        self.parts(sequence, len, |_, _| {});
    }

    /// The first part alone.
    fn begun(&mut self, sequence: u64, len: usize) {
        self.parts(sequence, len, |at, part| part.place = if at == 0 { PLACE } else { u16::MAX });
    }

    /// The connection is over.
    fn cut(&mut self) {
        self.steps.push("{\"cut\": true}".into());
        self.laptop.left(self.now_ns, SERVER);
    }

    fn finish(mut self) -> String {
        self.read();
        let missed = self.reader.as_ref().map(StreamReader::missed).unwrap_or_default();
        let counts = self.laptop.counts();
        let lost = &counts.received[0].lost;
        let refused = ReplicaLoss::ALL.into_iter().filter(|cause| lost.of(*cause) > 0);
        let refused: Vec<String> = refused.map(|cause| format!("\"{}\": {}", cause.word(), lost.of(cause))).collect();
        format!(
            "{{\"what\": \"{}\", \"stream\": \"steps\", \"place\": {PLACE}, \"record_bytes\": {RECORD_BYTES}, \
             \"records\": [{}], \"lost\": {}, \"sampled\": {}, \"refused\": {{{}}}, \"steps\": [\n{}\n]}}",
            self.what,
            self.records.join(", "),
            missed.lost,
            missed.sampled,
            refused.join(", "),
            self.steps.join(",\n")
        )
    }
}

fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    let mut case = Case::new("records come whole, of one part and several, and of no bytes");
    case.describe(100);
    [(5, 40), (6, 4096), (7, 4097), (8, 0)].into_iter().for_each(|(sequence, len)| case.record(sequence, len));
    all.push(case);

    let mut case = Case::new("before the description nothing is taken");
    case.record(1, 40);
    case.describe(usize::MAX);
    case.record(2, 40);
    all.push(case);

    let mut case = Case::described("gaps are lost, or were sampled as the parts say");
    for (sequence, sampled) in [(3, u32::MAX - 1), (5, u32::MAX), (9, 1), (12, 1)] {
        case.parts(sequence, 10, |_, part| part.sampled = sampled);
    }
    all.push(case);

    let mut case = Case::described("what came is not taken again, nor what is older");
    case.record(4, 4100);
    case.record(4, 4100);
    case.record(3, 10);
    case.record(5, 10);
    all.push(case);

    let mut case = Case::described("what is begun and not ended is incomplete");
    case.record(1, 10);
    case.begun(2, 9000);
    case.record(3, 10);
    case.begun(4, 9000);
    case.cut();
    case.record(5, 10);
    all.push(case);

    let mut case = Case::described("what cannot be a part is not taken");
    case.record(1, 10);
    case.record(2, RECORD_BYTES as usize + 1);
    case.parts(2, 10, |_, part| part.stamp_ns = 0);
    case.parts(2, 10, |_, part| (part.offset, part.bytes) = (1, &part.bytes[1..]));
    case.parts(2, 40, |_, part| part.bytes = &part.bytes[..1]);
    case.parts(2, 10, |_, part| part.description ^= 1);
    case.record(2, 10);
    all.push(case);

    let mut case = Case::described("a stream that is made anew begins anew, and nothing of before is taken");
    case.record(7, 10);
    case.generation = 1;
    case.record(0, 10);
    case.generation = 0;
    case.record(8, 10);
    case.generation = 1;
    case.record(1, 10);
    all.push(case);

    let mut case = Case::described("a later server goes on with the same stream");
    case.record(7, 10);
    case.server = 2;
    case.record(7, 10);
    case.record(9, 10);
    all.push(case);

    let mut case = Case::described("of a later server a stream may begin anew");
    case.record(7, 10);
    case.server = 2;
    case.record(0, 10);
    case.record(1, 10);
    all.push(case);
    all
}

#[test]
fn the_cases_for_other_languages_are_what_a_node_does() {
    let made: Vec<String> = cases().into_iter().map(Case::finish).collect();
    let text = format!("[\n{}\n]\n", made.join(",\n"));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&file, &text).unwrap();
    }
    let there = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(there == text, "{}: UPDATE_GOLDEN=1 writes it anew", file.display());
}
