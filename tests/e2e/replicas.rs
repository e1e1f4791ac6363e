//! A stream of one node is read on another as if it were written there: by this test, by the recorder and by tools.

use crate::harness::{OUTPUT, Place, Robot, head, until, wait};
use crate::network::{NETWORK, Network, addresses, at, launched_all, nodes};
use crate::process::Running;
use crate::recorded::{Frame, feed, feeder_entry, noise};
use crate::recorded_nodes::values;
use rohrpost::Name;
use rohrpost::wire::from_bytes;
use rohrpost_mailbox::{Missed, Next, Participant, RecordInfo, StreamId, StreamReader};
use rohrpost_recording::info;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const CLASSES: &str = "router 250, feeder 96, output 32, logd 24, tool 16";

const LOGD: &str = r#"
[[module]]
name = "logd.0"
node = "brain"
builtin = "logd"
stop-within = "60 s"
[record]
directory = "recordings"
streams = ["feeder.0/frame"]
leave-free = "0 B"
flush = "20 ms"
[[replica]]
stream = "feeder.0/frame"
to = ["brain"]
"#;

/// The number of the feeder's stream in its interface.
const FRAME: u16 = 2;

/// In its place where nodes send in time slots.
const SLOTS: &str = r#"
[network]
security = "none"
mode = "tdma"
[tdma]
cycle = "10 ms"
synchronisation = "1 ms"
guard = "400 us"
link = "1 Gbit/s"
[[slot]]
node = "base"
offset = "3 ms"
length = "2 ms"
[[slot]]
node = "brain"
offset = "6 ms"
length = "1 ms"
[time]
source = "master"
"#;

/// `network`: that section, and further ones.
fn config(place: &Place, [base, brain]: &[String; 2], network: &str) -> PathBuf {
    let nodes = nodes([("base", base), ("brain", brain)]);
    let modules = [at("base", OUTPUT), at("base", &feeder_entry(0)), LOGD.to_owned()].concat();
    place.write("test.toml", [&head(CLASSES), &nodes, network, &modules].concat())
}

/// A reader on a node, and all that it has read.
pub(crate) struct Follower {
    reader: StreamReader,
    records: BTreeMap<u64, (RecordInfo, Vec<u8>)>,
    lost: u64,
}

impl Follower {
    pub(crate) fn new(robot: &Robot) -> Self {
        let participant = Participant::join(&robot.node, Name::NONE).unwrap();
        let reader = participant.stream_reader(StreamId { name: robot.name("feeder.0"), number: FRAME }).unwrap();
        Self { reader, records: BTreeMap::new(), lost: 0 }
    }

    fn follow(&mut self) {
        loop {
            match self.reader.try_next().unwrap() {
                Next::Record(record) => {
                    let info = record.info();
                    let newest = self.records.last_key_value().map(|(sequence, _)| *sequence);
                    assert!(newest < Some(info.sequence), "{newest:?}, then {}", info.sequence);
                    self.records.insert(info.sequence, (info, record.body().to_vec()));
                }
                Next::Lost(lost) => self.lost += lost,
                Next::Nothing => return,
            }
        }
    }
}

/// Two nodes on this computer, at addresses of the loopback device.
pub(crate) fn launched_at(addresses: &[String; 2], network: &str) -> Network {
    launched_with(addresses, network, "")
}

/// `stream`: further keys of the replica's stream.
fn launched_with(addresses: &[String; 2], network: &str, stream: &str) -> Network {
    let place = Place::new();
    let config = config(&place, addresses, network);
    if !stream.is_empty() {
        let keys = format!("stream = {{ name = \"feeder.0/frame\"{stream} }}");
        let text = std::fs::read_to_string(&config).unwrap().replace("stream = \"feeder.0/frame\"", &keys);
        std::fs::write(&config, text).unwrap();
    }
    if network.contains("keys") {
        place.say(&["keys", "new", config.to_str().unwrap()]).ok();
    }
    Network::new(place, config, None).launched(&["base", "brain"])
}

/// Has the feeder write until its newest record is read on both nodes.
pub(crate) fn feed_through(pair: &Network, count: u64, [here, there]: [&mut Follower; 2]) {
    pair.says("base", &["call", "feeder.0", "feed", &count.to_string()]).ok();
    until("the newest record is read on the other node", || {
        here.follow();
        there.follow();
        let is_fed = pair.says("base", &["call", "feeder.0", "--json", "fed"]).ok().trim() != "null";
        let newest = [&*here, &*there].map(|of| of.records.last_key_value().map(|(sequence, _)| *sequence));
        let is_through = is_fed && newest[0].is_some() && newest[0] == newest[1];
        if !is_through {
            // A busy computer may have dropped a part of the newest: the next one says so.
            pair.says("base", &["call", "feeder.0", "feed", "1"]).ok();
        }
        is_through
    });
}

/// Each record of the replica is as it was written, and none is missing without a word.
pub(crate) fn compare(here: &Follower, there: &Follower) {
    assert_eq!(here.lost, 0);
    for (sequence, (info, body)) in &there.records {
        let (origin, written) = &here.records[sequence];
        let told = |info: &RecordInfo| (info.stamp, info.incarnation, info.len_bytes);
        assert_eq!((told(info), body), (told(origin), written), "record {sequence}");
        let frame: Frame = from_bytes(body).unwrap();
        assert_eq!(frame.bytes, noise(frame.number));
    }
    let (first, _) = there.records.first_key_value().unwrap();
    let newest = here.records.last_key_value().unwrap().0;
    assert!(there.records.len() as u64 + there.lost > newest - first, "each is read or told as lost");
}

#[test]
fn a_stream_of_another_node_is_read_as_if_written_here() {
    let pair = launched_at(&addresses(), NETWORK);
    let (mut here, mut there) = (Follower::new(pair.robot("base")), Follower::new(pair.robot("brain")));
    feed_through(&pair, 60, [&mut here, &mut there]);
    pair.robot("base").kill("feeder.0");
    feed_through(&pair, 60, [&mut here, &mut there]);

    compare(&here, &there);
    let incarnations: std::collections::BTreeSet<u32> =
        there.records.values().map(|(info, _)| info.incarnation).collect();
    assert_eq!(incarnations.len(), 2, "the writer has begun anew once");

    let at = ["--config", pair.config.to_str().unwrap(), "--node", "brain"];
    let stream = |words: &[&str]| pair.place.say(&[&["stream"], words, &at].concat()).ok();
    let list = stream(&["list"]);
    assert!(list.contains("the router, from node base"), "{list}");
    let info = stream(&["info", "feeder.0", "frame"]);
    assert!(info.contains("writer      the router, from node base\n"), "{info}");
    for (node, way) in [("base", "to brain"), ("brain", "from base")] {
        let net = pair.says(node, &["net"]).ok();
        let has_it = net.lines().any(|line| line.contains("feeder.0/frame") && line.contains(way));
        assert!(has_it, "{net}");
    }

    drop((here, there));
    let place = pair.stop();
    let recorded = values(&place.path("recordings/brain-0001.mcap"), "feeder.0/frame");
    assert!(recorded.len() > 60, "{} of the replica's records are recorded", recorded.len());
}

/// Both nodes in namespaces, with these words for launch, until the recorder of one follows the replica of the other's
/// stream; none where that cannot be made. `replica`: further keys of it.
fn followed(place: &Place, network: &str, replica: &str, words: &[&str]) -> Option<Running> {
    let config = config(place, &["10.77.0.1".into(), "10.77.0.2".into()], network);
    // The file ends with the replica.
    std::fs::write(&config, std::fs::read_to_string(&config).unwrap() + replica).unwrap();
    let launch = launched_all(place, &config, &["base", "brain"], words)?;
    until("the recorder follows the replica", || {
        feed(place, "feeder.0", 1);
        !recorded(place).is_empty()
    });
    Some(launch)
}

fn file(place: &Place) -> PathBuf {
    place.path("recordings/brain-0001.mcap")
}

fn recorded(place: &Place) -> Vec<(u32, u64)> {
    values(&file(place), "feeder.0/frame")
}

/// Has so many records written, and waits for one behind them; how many are recorded since the first, how many were
/// missed: all that were written; and how many of them were lost on the way.
fn feed_and_count(place: &Place, mut launch: Running, count: u64) -> (u64, u64, u64) {
    let target = feed(place, "feeder.0", count);
    until("records behind the last of them", || {
        feed(place, "feeder.0", 1);
        recorded(place).last().is_some_and(|(_, number)| *number > target)
    });
    let missed = told(place, &place.path("test.toml"));
    launch.stop();
    let (recorded, told) = (recorded(place), info(&file(place)).unwrap());
    assert!(recorded.is_sorted_by(|a, b| a.1 < b.1), "{recorded:?}");
    let channel = told.channels.iter().find(|channel| channel.topic == "feeder.0/frame").unwrap();
    let (first, last) = (recorded[0].1, recorded[recorded.len() - 1].1);
    assert!(recorded.len() as u64 + channel.lost > last - first, "{} recorded, {} lost", recorded.len(), channel.lost);
    // The ring's own count: the recorder came later, and may be slow.
    assert!(missed["lost"].as_u64().is_some() && missed["sampled"] == 0, "{missed}");
    (recorded.len() as u64, channel.lost, missed["lost"].as_u64().unwrap())
}

/// What `stream info` says on the other node of records that are missed, by cause.
fn told(place: &Place, config: &Path) -> Value {
    let at = ["--config", config.to_str().unwrap(), "--node", "brain", "--json"];
    place.say(&[&["stream", "info", "feeder.0", "frame"][..], &at].concat()).json()["missed"].clone()
}

/// Both nodes on the loopback device, with these further keys of the replica's stream; how many of each cause a reader
/// on the other node has missed that reads while so many are written, or after that, and what `stream info` says.
fn missed(stream: &str, count: u64, is_slow: bool) -> (Missed, Value) {
    let pair = launched_with(&addresses(), NETWORK, stream);
    let mut there = Follower::new(pair.robot("brain"));
    let id = there.reader.id();
    let mut feed_until = |what: &str, written: u64, follow: bool| {
        wait(what, || {
            pair.says("base", &["call", "feeder.0", "feed", "1"]).ok();
            if follow {
                there.follow();
            }
            let info = pair.robot("brain").node.inspect_stream(id).unwrap();
            info.map(|info| info.written).filter(|there| *there >= written)
        })
    };
    let first = feed_until("the replica begins", 1, true);
    pair.says("base", &["call", "feeder.0", "feed", &count.to_string()]).ok();
    let newest = feed_until("the last one, or a newer one, is there", first + count, !is_slow);
    there.follow();
    assert_eq!(there.reader.missed().all(), there.reader.accounts().1, "each has a cause");
    assert!(there.reader.position() >= newest);
    let (missed, told) = (there.reader.missed(), told(&pair.place, &pair.config));
    drop(there);
    pair.stop();
    (missed, told)
}

#[test]
fn what_sampling_leaves_out_is_told_so() {
    let (missed, told) = missed(", every = 5", 100, false);
    assert!(missed.sampled >= 60 && missed.passed_over == 0, "{missed:?}");
    assert!(told["sampled"].as_u64() >= Some(missed.sampled), "{told}");
}

#[test]
fn what_sampling_leaves_out_is_not_recorded_as_lost() {
    let pair = launched_with(&addresses(), NETWORK, ", every = 5");
    let file = pair.place.path("recordings/brain-0001.mcap");
    let feed_beyond = |number: u64| {
        until(format!("records behind {number} are recorded"), || {
            pair.says("base", &["call", "feeder.0", "feed", "1"]).ok();
            values(&file, "feeder.0/frame").last().is_some_and(|(_, newest)| *newest > number)
        });
    };
    feed_beyond(0);
    pair.says("base", &["call", "feeder.0", "feed", "200"]).ok();
    feed_beyond(200);
    let _place = pair.stop();
    let (recorded, told) = (values(&file, "feeder.0/frame"), info(&file).unwrap());
    let channel = told.channels.iter().find(|channel| channel.topic == "feeder.0/frame").unwrap();
    // The first one is sent whatever its number, so that the replica has one.
    let wanted = (recorded[recorded.len() - 1].1 - recorded[1].1) / 5 + 2;
    assert_eq!((recorded.len() as u64 + channel.lost, channel.losses.all()), (wanted, channel.lost), "{channel:?}");
}

#[test]
fn what_a_reader_is_too_slow_for_is_told_so() {
    let (missed, told) = missed("", 700, true);
    assert!(missed.passed_over > 0 && missed.sampled == 0, "{missed:?}");
    assert!(told["passed_over"].as_u64() >= Some(missed.passed_over), "{told}");
}

#[test]
fn over_a_network_that_loses_datagrams_records_are_whole_or_told_as_lost() {
    let place = Place::new();
    let bad = ["--impair", "loss=2%,delay=1ms,reorder=5%,seed=22"];
    // What is lost stays lost.
    let Some(launch) = followed(&place, NETWORK, "deadline = \"0 ms\"\n", &bad) else { return };
    let (recorded, missed, lost) = feed_and_count(&place, launch, 300);
    assert!(missed > 0 && lost > 0 && recorded > 100, "{recorded} recorded, {missed} missed, {lost} lost on the way");
    place.assert_empty();
}

#[test]
fn in_time_slots_records_cross_as_well() {
    let place = Place::new();
    let Some(launch) = followed(&place, SLOTS, "", &[]) else { return };
    let (recorded, missed, _) = feed_and_count(&place, launch, 200);
    assert!(recorded > 100, "{recorded} recorded, {missed} missed");
    place.assert_empty();
}
