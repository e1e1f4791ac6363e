//! Files as other programs write them, with every combination of what MCAP leaves to a writer: each is whole, and all
//! of it comes back, whatever is made of it.

use super::support::memory_folder;
use crate::format::op;
use crate::read::contents::{Contents, Item};
use crate::reader::Reader;
use crate::write::records;
use crate::{Selection, cut, info, merge, recover};
use std::path::Path;

/// What a writer does, or leaves out.
const FEATURES: [&str; 9] = [
    "chunks",
    "statistics",
    "described again",
    "offsets of the summary",
    "index of attachments and metadata",
    "index of messages",
    "bytes behind records",
    "attachment",
    "metadata",
];

/// Which of them a file has.
#[derive(Clone, Copy)]
struct Features(u32);

impl Features {
    fn has(self, feature: &str) -> bool {
        self.0 & (1 << FEATURES.iter().position(|its| *its == feature).unwrap()) != 0
    }

    fn names(self) -> Vec<&'static str> {
        FEATURES.into_iter().filter(|feature| self.has(feature)).collect()
    }
}

/// Log times of the messages, in the order of the file; the numbers of channels follow each other.
const TIMES: [u64; 8] = [3, 0, 5, 1, 4, 2, 7, 6];
const IN_CHUNK: usize = 4;
const CHANNELS: u16 = 3;
const ATTACHED: &[u8] = &[1, 2, 3];

/// Writes one, as the specification says.
struct Generated {
    features: Features,
    bytes: Vec<u8>,
    chunk_indexes: Vec<u8>,
    attachment_index: Vec<u8>,
    metadata_index: Vec<u8>,
}

impl Generated {
    fn file(features: Features) -> Vec<u8> {
        let empty = Vec::new;
        let mut its = Self {
            features,
            bytes: mcap::MAGIC.to_vec(),
            chunk_indexes: empty(),
            attachment_index: empty(),
            metadata_index: empty(),
        };
        its.bytes.extend(its.record(op::HEADER, |body| {
            body.text("theirs").text("");
        }));
        if !features.has("chunks") {
            let definitions = its.definitions();
            its.bytes.extend(definitions);
        }
        for number in 0..TIMES.len() / IN_CHUNK {
            its.messages(number);
        }
        if features.has("attachment") {
            its.attachment();
        }
        if features.has("metadata") {
            its.metadata();
        }
        its.end();
        its.bytes
    }

    /// A record, with two bytes more that later versions of the format may add.
    fn record(&self, op: u8, fill: impl FnOnce(&mut records::Body<'_>)) -> Vec<u8> {
        let mut bytes = Vec::new();
        let is_extensible = !matches!(op, op::MESSAGE | op::DATA_END | op::FOOTER);
        let more = is_extensible && self.features.has("bytes behind records");
        records::put(&mut bytes, op, |body| {
            fill(body);
            if more {
                body.raw(&[1, 255]);
            }
        });
        bytes
    }

    /// Three channels of two types; two of them have one topic.
    fn definitions(&self) -> Vec<u8> {
        let schema = |id: u16, name: &str| {
            self.record(op::SCHEMA, |body| {
                body.u16(id).text(name).text("jsonschema").bytes(b"{}");
            })
        };
        let channel = |id: u16, schema: u16, topic: &str| {
            self.record(op::CHANNEL, |body| {
                body.u16(id).u16(schema).text(topic).text("json").list(|body| {
                    body.text("name").text("theirs");
                });
            })
        };
        [schema(1, "One"), schema(2, "Two"), channel(0, 1, "/a"), channel(1, 2, "/a"), channel(2, 0, "/b")].concat()
    }

    fn message(&self, number: usize) -> Vec<u8> {
        self.record(op::MESSAGE, |body| {
            let log_ns = TIMES[number];
            body.u16(number as u16 % CHANNELS).u32(number as u32).u64(log_ns).u64(log_ns + 100).raw(&[number as u8; 9]);
        })
    }

    fn messages(&mut self, chunk: usize) {
        let numbers = chunk * IN_CHUNK..(chunk + 1) * IN_CHUNK;
        if !self.features.has("chunks") {
            let all = numbers.map(|number| self.message(number)).collect::<Vec<_>>().concat();
            return self.bytes.extend(all);
        }
        let mut inside = if chunk == 0 { self.definitions() } else { Vec::new() };
        let mut places: [Vec<(u64, u64)>; CHANNELS as usize] = Default::default();
        for number in numbers.clone() {
            places[number % CHANNELS as usize].push((TIMES[number], inside.len() as u64));
            inside.extend(self.message(number));
        }
        let times = || numbers.clone().map(|number| TIMES[number]);
        let (first, last, len) = (times().min().unwrap(), times().max().unwrap(), inside.len() as u64);
        let chunk_at = self.bytes.len() as u64;
        let chunk = self.record(op::CHUNK, |body| {
            body.u64(first).u64(last).u64(len).u32(crc32fast::hash(&inside)).text("").u64(len).raw(&inside);
        });
        let chunk_len = chunk.len() as u64;
        self.bytes.extend(chunk);
        let (index_at, mut offsets) = (self.bytes.len() as u64, Vec::new());
        if self.features.has("index of messages") {
            for (id, places) in places.iter().enumerate() {
                offsets.push((id as u16, self.bytes.len() as u64));
                self.bytes.extend(self.record(op::MESSAGE_INDEX, |body| {
                    body.u16(id as u16).list(|body| {
                        for (log_ns, at) in places {
                            body.u64(*log_ns).u64(*at);
                        }
                    });
                }));
            }
        }
        let index_len = self.bytes.len() as u64 - index_at;
        let index = self.record(op::CHUNK_INDEX, |body| {
            body.u64(first).u64(last).u64(chunk_at).u64(chunk_len).list(|body| {
                for (id, at) in offsets {
                    body.u16(id).u64(at);
                }
            });
            body.u64(index_len).text("").u64(len).u64(len);
        });
        self.chunk_indexes.extend(index);
    }

    fn attachment(&mut self) {
        let mut body = Vec::new();
        records::body(&mut body, |body| {
            body.u64(2).u64(1).text("calib.bin").text("application/octet-stream").u64(ATTACHED.len() as u64);
            body.raw(ATTACHED);
        });
        let sum = crc32fast::hash(&body);
        let (at, record) = (
            self.bytes.len() as u64,
            self.record(op::ATTACHMENT, |record| {
                record.raw(&body).u32(sum);
            }),
        );
        self.attachment_index = self.record(op::ATTACHMENT_INDEX, |body| {
            body.u64(at).u64(record.len() as u64).u64(2).u64(1).u64(ATTACHED.len() as u64);
            body.text("calib.bin").text("application/octet-stream");
        });
        self.bytes.extend(record);
    }

    fn metadata(&mut self) {
        let (at, record) = (
            self.bytes.len() as u64,
            self.record(op::METADATA, |body| {
                body.text("rohrpost.session").list(|body| {
                    body.text("robot").text("theirs");
                });
            }),
        );
        self.metadata_index = self.record(op::METADATA_INDEX, |body| {
            body.u64(at).u64(record.len() as u64).text("rohrpost.session");
        });
        self.bytes.extend(record);
    }

    fn end(&mut self) {
        let features = self.features;
        let sum = crc32fast::hash(&self.bytes);
        self.bytes.extend(self.record(op::DATA_END, |body| {
            body.u32(sum);
        }));
        let statistics = self.record(op::STATISTICS, |body| {
            let chunks = if features.has("chunks") { TIMES.len() / IN_CHUNK } else { 0 };
            body.u64(TIMES.len() as u64).u16(2).u32(CHANNELS.into()).u32(features.has("attachment").into());
            body.u32(features.has("metadata").into()).u32(chunks as u32).u64(0).u64(7).list(|body| {
                for id in 0..CHANNELS {
                    body.u16(id).u64((0..TIMES.len()).filter(|number| *number as u16 % CHANNELS == id).count() as u64);
                }
            });
        });
        let indexes = [self.attachment_index.clone(), self.metadata_index.clone()].concat();
        let groups = [
            (features.has("described again"), op::CHANNEL, self.definitions()),
            (features.has("statistics"), op::STATISTICS, statistics),
            (features.has("described again"), op::CHUNK_INDEX, self.chunk_indexes.clone()),
            (features.has("index of attachments and metadata"), op::ATTACHMENT_INDEX, indexes),
        ];
        let begins = self.bytes.len() as u64;
        let mut offsets = Vec::new();
        for (_, op, records) in groups.into_iter().filter(|(is_there, _, records)| *is_there && !records.is_empty()) {
            let at = self.bytes.len() as u64;
            offsets.extend(self.record(op::SUMMARY_OFFSET, |body| {
                body.u8(op).u64(at).u64(records.len() as u64);
            }));
            self.bytes.extend(records);
        }
        let offsets_at = self.bytes.len() as u64;
        let begins = if offsets_at == begins { 0 } else { begins };
        let has_offsets = features.has("offsets of the summary") && begins > 0;
        if has_offsets {
            self.bytes.extend(offsets);
        }
        let mut footer = Vec::new();
        records::put(&mut footer, op::FOOTER, |body| {
            body.u64(begins).u64(if has_offsets { offsets_at } else { 0 }).u32(0);
        });
        self.bytes.extend([&footer[..], mcap::MAGIC].concat());
    }
}

/// Each message: topic, type, sequence and times, in the order of the file.
fn messages(path: &Path) -> Vec<(String, String, u32, u64, u64)> {
    let (mut contents, mut all) = (Contents::open(path).unwrap(), Vec::new());
    while let Some(item) = contents.next().unwrap() {
        match item {
            Item::Message(found) => {
                let (channel, header) = (&found.channel, found.header);
                assert_eq!(
                    (contents.data(&found), &*channel.unheeded["name"]),
                    (&[header.sequence as u8; 9][..], "theirs")
                );
                let (topic, schema) = (channel.topic.clone(), channel.schema.name.clone());
                all.push((topic, schema, header.sequence, header.log_time, header.publish_time));
            }
            Item::Metadata(_) | Item::Attachment(_) => {}
            Item::Damaged(at, damage) => panic!("{}: {at}: {damage}", path.display()),
        }
    }
    all
}

/// That all of a file is there, `times` as often.
fn check(path: &Path, features: Features, times: usize, case: &str) {
    let told = info(path).unwrap_or_else(|error| panic!("{case}: {error}"));
    let counts = (told.messages, told.is_closed, told.damage_count);
    assert_eq!(counts, ((TIMES.len() * times) as u64, true, 0), "{case}: {told:?}");
    let lines: Vec<_> = told.channels.iter().map(|its| (its.topic.as_str(), its.type_name.as_str())).collect();
    assert_eq!(lines, [("/a", "One"), ("/a", "Two"), ("/b", "")], "{case}: one topic, two types");
    assert_eq!((told.first_ns, told.last_ns, told.profile.as_str()), (Some(0), Some(7), "theirs"), "{case}");
    let attached: Vec<_> = told.attachments.iter().map(|its| (its.name.as_str(), its.bytes)).collect();
    let wanted = if features.has("attachment") { times } else { 0 };
    assert_eq!(attached, vec![("calib.bin", ATTACHED.len() as u64); wanted], "{case}");
    let is_theirs = |name: &str| name == "rohrpost.session";
    let metadata = told.others.iter().filter(|(name, texts)| is_theirs(name) && texts["robot"] == "theirs").count();
    assert_eq!(metadata, if features.has("metadata") { times } else { 0 }, "{case}");
    let mut reader = Reader::to_play(path).unwrap();
    let mut played = Vec::new();
    while let Some((_, message)) = reader.next().unwrap_or_else(|error| panic!("{case}: {error}")) {
        played.push(message.arrival_ns);
    }
    let in_time: Vec<u64> = (0..TIMES.len() as u64).flat_map(|ns| std::iter::repeat_n(ns, times)).collect();
    assert!(played == in_time && reader.is_closed(), "{case}: {played:?}");
    assert!(reader.seek(5).unwrap());
    assert_eq!(reader.next().unwrap().unwrap().1.arrival_ns, 5, "{case}");
}

/// What is made of a file that another program wrote.
pub(super) fn made_of(path: &Path, folder: &Path, case: &str) -> [std::path::PathBuf; 3] {
    let [part, merged, whole] = ["part", "merged", "whole"].map(|name| folder.join(name));
    cut(path, &part, &Selection::default(), &mut |_, _| {}).unwrap_or_else(|error| panic!("{case}: {error}"));
    merge(&[path.to_owned(), path.to_owned()], &merged, &mut |_, _| {})
        .unwrap_or_else(|error| panic!("{case}: {error}"));
    let told = recover(path, &whole, &mut |_, _| {}).unwrap_or_else(|error| panic!("{case}: {error}"));
    assert_eq!((told.damage_count, told.was_closed, told.unchecked), (0, true, 0), "{case}: {told:?}");
    [part, merged, whole]
}

#[test]
fn all_of_others_comes_back_whatever_their_writer_leaves_out() {
    for bits in 0..1 << FEATURES.len() {
        let features = Features(bits);
        let case = format!("with {:?}", features.names());
        let folder = memory_folder();
        let path = folder.path().join("theirs.mcap");
        std::fs::write(&path, Generated::file(features)).unwrap();
        check(&path, features, 1, &case);
        let wanted = messages(&path);
        assert_eq!(wanted.len(), TIMES.len(), "{case}");
        let [part, merged, whole] = made_of(&path, folder.path(), &case);
        for (made, times) in [(&part, 1), (&merged, 2), (&whole, 1)] {
            check(made, features, times, &format!("{case}, {}", made.display()));
        }
        assert_eq!([messages(&part), messages(&whole)], [wanted.clone(), wanted], "{case}");
    }
}
