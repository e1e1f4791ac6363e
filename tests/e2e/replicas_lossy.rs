//! Large records and poses of one node on another, over a network that loses one datagram in a hundred: lost parts are
//! asked for, so that records are whole, and what is not is told.
//!
//! Only what was written and what came counts, not when: a busy computer passes records over, and says so.

use crate::harness::{NoSettings, OUTPUT, Place, Robot, head, program, run_if_launched, until, wait};
use crate::network::{NETWORK, Network, addresses, at, nodes};
use rohrpost::{Context, Module, ModuleError, Name, data};
use rohrpost_mailbox::{Next, Participant, StreamId, StreamReader};
use serde_json::Value;
use std::time::Duration;

/// About 3000 datagrams.
const PICTURE_BYTES: usize = 4 << 20;
const PICTURES: u64 = 100;
/// As long as a quick computer needs for one, and some more.
const PICTURE_PERIOD_MS: u64 = 150;
const POSES: u64 = 3000;
const POSE_PERIOD: Duration = Duration::from_millis(5);
/// The number of either stream in its interface.
const NUMBER: u16 = 2;

/// Not a test: a module that launch starts. Run as a test it ends at once.
#[test]
fn camera() {
    run_if_launched::<Camera>();
}

/// The same.
#[test]
fn localiser() {
    run_if_launched::<Localiser>();
}

/// Bytes as of a camera.
#[data]
struct Picture {
    bytes: Vec<u8>,
}

/// What is in the picture of a sequence: each part differs from all others near it.
fn pixels(sequence: u64) -> Vec<u8> {
    let mut bytes = vec![0; PICTURE_BYTES];
    for (row, bytes) in (sequence * 77..).zip(bytes.chunks_mut(1000)) {
        bytes.fill(row as u8);
        bytes[..8].copy_from_slice(&row.to_le_bytes());
    }
    bytes
}

#[rohrpost::interface(class = "camera")]
trait Photographing {
    /// Takes so many more.
    #[command(16)]
    fn feed(&mut self, count: u64);

    /// Takes one in so many milliseconds from now on.
    #[command(18)]
    fn pace(&mut self, period_ms: u64);

    /// Whether all are taken.
    #[command(17, idempotent)]
    fn is_fed(&mut self) -> bool;

    /// The pictures.
    #[stream(2)]
    fn picture() -> Picture;
}

#[rohrpost::interface(class = "localiser")]
trait Localising {
    /// Says so many times more where it is.
    #[command(16)]
    fn feed(&mut self, count: u64);

    /// Whether that is done.
    #[command(17, idempotent)]
    fn is_fed(&mut self) -> bool;

    /// Where it is: its sequence.
    #[stream(2)]
    fn pose() -> [u64; 8];
}

struct Camera {
    wanted: u64,
    taken: u64,
    /// What was asked for since the last tick.
    period_ms: Option<u64>,
}

impl Module for Camera {
    type Settings = NoSettings;
    type Interfaces = PhotographingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(PICTURE_PERIOD_MS));
        Ok(Self { wanted: 0, taken: 0, period_ms: None })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if let Some(period_ms) = self.period_ms.take() {
            context.set_period(Duration::from_millis(period_ms));
        }
        if self.taken < self.wanted {
            context.write_now(PhotographingInterface::PICTURE, &Picture { bytes: pixels(self.taken) })?;
            self.taken += 1;
        }
        Ok(())
    }
}

impl Photographing for Camera {
    fn feed(&mut self, count: u64) {
        self.wanted += count;
    }

    fn pace(&mut self, period_ms: u64) {
        self.period_ms = Some(period_ms);
    }

    fn is_fed(&mut self) -> bool {
        self.taken == self.wanted
    }
}

struct Localiser {
    wanted: u64,
    said: u64,
}

impl Module for Localiser {
    type Settings = NoSettings;
    type Interfaces = LocalisingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(POSE_PERIOD);
        Ok(Self { wanted: 0, said: 0 })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if self.said < self.wanted {
            context.write_now(LocalisingInterface::POSE, &[self.said; 8])?;
            self.said += 1;
        }
        Ok(())
    }
}

impl Localising for Localiser {
    fn feed(&mut self, count: u64) {
        self.wanted += count;
    }

    fn is_fed(&mut self) -> bool {
        self.said == self.wanted
    }
}

pub(crate) const CLASSES: &str = "router 250, localiser 128, camera 96, output 32, tool 16";

const REPLICAS: &str = r#"
[[replica]]
stream = "camera.0/picture"
to = ["brain"]
delay-alarm = "60 s"
[[replica]]
stream = "localiser.0/pose"
to = ["brain"]
delay-alarm = "60 s"
"#;

/// The table of a module of this file, with its stream.
pub(crate) fn entry(name: &str, node: &str) -> String {
    let (test, stream) = if name.starts_with("camera.") {
        ("camera", "picture]\nrecord = \"5 MiB\"\nkeep = 4\nreaders = 2\n")
    } else {
        ("localiser", "pose]\nrecord = \"128 B\"\nkeep = 256\n")
    };
    let program = program(&format!("replicas_lossy::{test}"));
    format!("[[module]]\nname = \"{name}\"\nnode = \"{node}\"\nprogram = {program}\n[module.stream.{stream}")
}

/// Whether a record is as it was written.
pub(crate) type Right = fn(u64, &[u8]) -> bool;

/// A reader of a replica, and what it has read.
pub(crate) struct Follower {
    reader: StreamReader,
    is_right: Right,
    pub(crate) newest: Option<u64>,
    pub(crate) records: u64,
    lost: u64,
}

impl Follower {
    pub(crate) fn new(robot: &Robot, module: &str, is_right: Right) -> Self {
        let participant = Participant::join(&robot.node, Name::NONE).unwrap();
        let reader = participant.stream_reader(StreamId { name: robot.name(module), number: NUMBER }).unwrap();
        Self { reader, is_right, newest: None, records: 0, lost: 0 }
    }

    pub(crate) fn follow(&mut self) {
        loop {
            match self.reader.try_next().unwrap() {
                Next::Record(record) => {
                    let sequence = record.info().sequence;
                    assert!((self.is_right)(sequence, record.body()), "record {sequence} is not as it was written");
                    assert!(self.newest < Some(sequence), "{:?}, then {sequence}", self.newest);
                    self.newest = Some(sequence);
                    self.records += 1;
                }
                Next::Lost(lost) => self.lost += lost,
                Next::Nothing => return,
            }
        }
    }

    /// The newest sequence, and how many were read or told as lost.
    pub(crate) fn told(&self) -> [u64; 2] {
        [self.newest.unwrap_or_default(), self.records + self.lost]
    }
}

pub(crate) fn is_picture(sequence: u64, body: &[u8]) -> bool {
    body.ends_with(&pixels(sequence))
}

pub(crate) fn is_pose(sequence: u64, body: &[u8]) -> bool {
    rohrpost::wire::from_bytes::<[u64; 8]>(body).is_ok_and(|pose| pose == [sequence; 8])
}

/// Two nodes on this computer, and readers of both replicas on the second.
struct Trial {
    network: Network,
    /// By stream: its module, how many records it was told to write, and a reader.
    streams: [(&'static str, u64, Follower); 2],
}

impl Trial {
    fn launched(bad: &'static str) -> Self {
        let (place, [base, brain]) = (Place::new(), addresses());
        let nodes = nodes([("base", &base), ("brain", &brain)]);
        let modules = [at("base", OUTPUT), entry("camera.0", "base"), entry("localiser.0", "base")].concat();
        let config = place.write("test.toml", [&head(CLASSES), &nodes, NETWORK, &modules, REPLICAS].concat());
        let network = Network::new(place, config, None).impaired(bad).launched(&["base", "brain"]);
        let follow = |module, is_right| (module, 0, Follower::new(network.robot("brain"), module, is_right));
        let streams = [follow("camera.0", is_picture as Right), follow("localiser.0", is_pose)];
        Self { network, streams }
    }

    fn call(&self, words: &[&str]) -> String {
        self.network.says("base", &[&["call"], words].concat()).ok()
    }

    /// Has both written so many more, until the last of these, or a newer one, has come.
    fn write(&mut self, counts: [u64; 2]) {
        for (at, count) in counts.into_iter().enumerate() {
            self.call(&[self.streams[at].0, "feed", &count.to_string()]);
            self.streams[at].1 += count;
        }
        let last = [0, 1].map(|at: usize| self.streams[at].1 - 1);
        until("the last of both has come", || {
            for (at, last) in last.into_iter().enumerate() {
                self.streams.iter_mut().for_each(|(.., follower)| follower.follow());
                let (module, _, ref follower) = self.streams[at];
                // A busy computer may have passed over the last one, and the description comes each second.
                if follower.newest < Some(last) && self.call(&[module, "--json", "is_fed"]).trim() == "true" {
                    self.call(&[module, "feed", "1"]);
                    self.streams[at].1 += 1;
                }
            }
            let has_come = |at: usize| self.streams[at].2.newest >= Some(last[at]);
            has_come(0) && has_come(1)
        });
    }

    /// What a router says of a replica on its side.
    fn state(&self, (router, node, side): (&str, &str, &str), stream: &str) -> Value {
        let echo = ["echo", router, "replicas", "--count", "1", "--json"];
        let told = self.network.says(node, &echo).json();
        let all = told["value"][side].as_array().unwrap_or_else(|| panic!("{told}"));
        all.iter().find(|state| state["stream"] == stream).unwrap_or_else(|| panic!("{told}")).clone()
    }

    /// Of a stream: records sent, records that came whole, and what both ends say.
    fn counted(&self, stream: &str) -> (u64, u64, [Value; 2]) {
        let [sent, came] =
            [("router.0", "base", "sent"), ("router.1", "brain", "received")].map(|side| self.state(side, stream));
        (count(&sent, "records"), count(&came, "records"), [sent, came])
    }
}

fn count(state: &Value, key: &str) -> u64 {
    state[key].as_u64().unwrap_or_else(|| panic!("no `{key}`: {state}"))
}

#[test]
fn of_a_hundred_large_records_ninety_nine_are_whole_and_the_rest_is_told() {
    const STREAMS: [&str; 2] = ["camera.0/picture", "localiser.0/pose"];
    let mut trial = Trial::launched("loss=1%,delay=1ms,reorder=1%,seed=22");
    trial.write([1, 1]);
    // A picture that is still under way when the next ones are taken is passed over, which is no loss of the network.
    let came = || trial.state(("router.1", "brain", "received"), STREAMS[0])["delay_worst_ns"].as_u64();
    let period_ms = PICTURE_PERIOD_MS.max(2 * wait("how long a picture takes", came) / 1_000_000);
    trial.call(&["camera.0", "pace", &period_ms.to_string()]);
    let before = STREAMS.map(|stream| trial.counted(stream));
    let told_before = [0, 1].map(|at: usize| trial.streams[at].2.told());
    trial.write([PICTURES, POSES]);
    for (at, least_percent) in [(0, 99), (1, 97)] {
        let (_, fed, follower) = &trial.streams[at];
        let [newest, told] = [0, 1].map(|of: usize| follower.told()[of] - told_before[at][of]);
        assert_eq!(told, newest, "each is read or told as lost");
        assert!(follower.newest < Some(*fed));
        // The router publishes twice a second or so.
        let (sent, came, states) = wait("what came is counted", || {
            let counted = trial.counted(STREAMS[at]);
            (counted.1 >= follower.records).then_some(counted)
        });
        let (sent, came) = (sent - before[at].0, came - before[at].1);
        assert!(sent >= [PICTURES, POSES][at] / 2, "{} of {} were passed over", STREAMS[at], states[0]);
        assert!(100 * came >= least_percent * sent, "{came} of {sent} came whole: {states:?}");
        let [again, asked, completed] =
            [(0, "again"), (1, "asked"), (1, "completed")].map(|(end, key)| count(&states[end], key));
        assert!(again > 0 && asked > 0 && completed > 0, "{states:?}");
    }
    drop(trial.streams);
    trial.network.stop();
}
