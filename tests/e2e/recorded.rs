//! The built-in module `logd` on a running node: all that was sent is in its files, or counted; they are whole, also
//! after it was killed; and a disk that is not there is told, and disturbs nobody.

use crate::harness::{
    NoSettings, OUTPUT, Place, RECORDED_CLASSES, Robot, assert_has, program, run_if_launched, signal, until, wait,
};
use crate::process::Running;
use crate::recordings;
use nix::sys::signal::Signal;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rohrpost::wire::from_bytes;
use rohrpost::{Context, Module, ModuleError, data};
use rohrpost_mailbox::StreamId;
use rohrpost_recording::{LossCause, info, is_closed};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Not a test: a module that launch starts. Run as a test it ends at once.
#[test]
fn feeder() {
    run_if_launched::<Feeder>();
}

/// Larger than what data mailboxes take.
#[data]
pub(crate) struct Frame {
    pub(crate) number: u64,
    pub(crate) bytes: Vec<u8>,
}

pub(crate) const FRAME_BYTES: usize = 10_000;

/// The bytes of a frame. As those of a camera, they do not get shorter by compression.
pub(crate) fn noise(number: u64) -> Vec<u8> {
    let mut bytes = vec![0; FRAME_BYTES];
    ChaCha8Rng::seed_from_u64(number).fill_bytes(&mut bytes);
    bytes
}

/// Publishes as much as it is told to: numbers from 1 on.
#[rohrpost::interface(class = "feeder")]
trait Feeding {
    /// Sends so many more of each item.
    #[command(16)]
    fn feed(&mut self, count: u64);

    /// Values of each item sent so far; none while more are to be sent.
    #[command(17, idempotent)]
    fn fed(&mut self) -> Option<u64>;

    /// As data.
    #[data(1)]
    fn count() -> u64;

    /// As a stream.
    #[stream(2)]
    fn frame() -> Frame;
}

struct Feeder {
    wanted: u64,
    sent: u64,
}

impl Module for Feeder {
    type Settings = NoSettings;
    type Interfaces = FeedingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(1));
        Ok(Self { wanted: 0, sent: 0 })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if self.sent < self.wanted {
            let number = self.sent + 1;
            context.publish_now(FeedingInterface::COUNT, &number)?;
            context.write_now(FeedingInterface::FRAME, &Frame { number, bytes: noise(number) })?;
            self.sent = number;
        }
        Ok(())
    }
}

impl Feeding for Feeder {
    fn feed(&mut self, count: u64) {
        self.wanted += count;
    }

    fn fed(&mut self) -> Option<u64> {
        (self.sent == self.wanted).then_some(self.sent)
    }
}

const LOGD: &str = r#"
[[module]]
name = "logd.0"
builtin = "logd"
stop-within = "60 s"
[module.mailbox.data]
slots = 1024
"#;

pub(crate) const RECORD: &str = r#"
[record]
directory = "recordings"
streams = ["feeder.0/*", { name = "feeder.1/frame", every = 7 }]
data = ["*", { name = "feeder.1/count", every = 10 }]
output = "info"
drawn = true
leave-free = "0 B"
flush = "20 ms"
sync = "100 ms"
"#;

pub(crate) fn feeder_entry(number: u8) -> String {
    let program = program("recorded::feeder");
    format!(
        "[[module]]\nname = \"feeder.{number}\"\nprogram = {program}\n[module.stream.frame]\n\
         record = \"16 KiB\"\nkeep = 512\n"
    )
}

pub(crate) fn launched(record: &str) -> (Place, Running, Robot) {
    let place = Place::new();
    let (launch, robot) = launched_with(&place, LOGD, record);
    (place, launch, robot)
}

/// The same, with another entry of the recorder.
pub(crate) fn launched_with(place: &Place, logd: &str, record: &str) -> (Running, Robot) {
    let config = place.config(&[&RECORDED_CLASSES, OUTPUT, logd, &feeder_entry(0), &feeder_entry(1), record]);
    place.launched_from(&config)
}

fn call(place: &Place, module: &str, function: &[&str]) -> Value {
    place.say(&[&["call", module, "--json"], function].concat()).json()
}

/// Feeds, and waits until all is sent. What was sent so far.
pub(crate) fn feed(place: &Place, module: &str, count: u64) -> u64 {
    place.say(&["call", module, "feed", &count.to_string()]).ok();
    wait(format!("{module} has sent"), || call(place, module, &["fed"]).as_u64())
}

/// What became of a channel's messages: in files, and lost.
fn accounts(place: &Place) -> BTreeMap<String, (u64, u64)> {
    let page = call(place, "logd.0", &["channels", "0"]);
    let channel = |its: &Value| {
        let count = |key: &str| its[key].as_u64().unwrap();
        (its["topic"].as_str().unwrap().to_owned(), (count("written"), count("lost")))
    };
    page["channels"].as_array().unwrap().iter().map(channel).collect()
}

/// Feeds one by one until the recorder has something of each item: from then on nothing may be missing without being
/// counted.
pub(crate) fn feed_until_recorded(place: &Place, module: &str) {
    until(format!("{module} is recorded"), || {
        feed(place, module, 1);
        let accounts = accounts(place);
        let has = |item: &str| accounts.get(&format!("{module}/{item}")).is_some_and(|(written, _)| *written > 0);
        has("count") && has("frame")
    });
}

/// Messages of a topic in a file but those that it repeats, also in one that is being written.
fn messages<T>(file: &Path, topic: &str, read: impl Fn(&[u8]) -> T) -> Vec<T> {
    recordings::messages_so_far(file, |channel, message| {
        (channel.topic == topic && !channel.is_repeated()).then(|| read(message.data))
    })
}

/// The number in a value of a feeder's topic, of which the bytes are right.
pub(crate) fn number(topic: &str, bytes: &[u8]) -> u64 {
    if topic.ends_with("/count") {
        return from_bytes(bytes).unwrap();
    }
    let frame: Frame = from_bytes(bytes).unwrap();
    assert!(frame.bytes == noise(frame.number), "frame {} has other bytes than those that were sent", frame.number);
    frame.number
}

/// Numbers of all values of a topic.
pub(crate) fn numbers(file: &Path, topic: &str) -> Vec<u64> {
    let numbers = messages(file, topic, |bytes| number(topic, bytes));
    assert!(numbers.is_sorted_by(|a, b| a < b), "{topic}: {numbers:?}");
    numbers
}

/// Texts of the recorded lines of output.
pub(crate) fn lines(file: &Path) -> Vec<String> {
    messages(file, "output.0/line", |bytes| from_bytes::<rohrpost::output::OutputLine>(bytes).unwrap().text)
}

/// Waits until all values of a topic, one in `every`, are in files or lost, from the first one in this file on.
pub(crate) fn wait_for_all(place: &Place, file: &Path, topic: &str, last: u64, every: u64) {
    wait(format!("all of {topic} are recorded"), || {
        let first = *numbers(file, topic).first()?;
        let (written, lost) = *accounts(place).get(topic)?;
        (written + lost > (last - first) / every).then_some(())
    });
}

/// From the first one that is there to the last one that was sent, each is in the file or counted as lost.
#[track_caller]
pub(crate) fn assert_all_there(file: &Path, topic: &str, last: u64, every: u64) -> Vec<u64> {
    let (info, numbers) = (info(file).unwrap(), numbers(file, topic));
    let channel = info.channels.iter().find(|channel| channel.topic == topic).unwrap();
    let first = numbers.first().copied().unwrap();
    let sent = (last - first) / every + 1;
    assert_eq!(numbers.len() as u64 + channel.lost, sent, "{topic} from {first} to {last}: {numbers:?}");
    assert!(numbers.iter().all(|number| (number - first).is_multiple_of(every)), "{topic}: {numbers:?}");
    numbers
}

#[test]
fn what_is_named_is_recorded_and_each_value_is_in_the_file_or_counted() {
    /// Of the second feeder one in ten and one in seven are wanted, by the numbers of packages and records.
    const TOPICS: [(&str, u64); 4] =
        [("feeder.0/count", 1), ("feeder.0/frame", 1), ("feeder.1/count", 10), ("feeder.1/frame", 7)];
    let (place, mut launch, _robot) = launched(RECORD);
    let file = place.path("recordings/main-0001.mcap");
    ["feeder.0", "feeder.1"].iter().for_each(|module| feed_until_recorded(&place, module));
    let last: Vec<u64> = ["feeder.0", "feeder.1"].iter().map(|module| feed(&place, module, 400)).collect();
    let last = |topic: &str| last[usize::from(topic.starts_with("feeder.1"))];
    for (topic, every) in TOPICS {
        wait_for_all(&place, &file, topic, last(topic), every);
    }
    let state = call(&place, "logd.0", &["recording"]);
    assert_eq!((&state["problem"], state["file"].is_string()), (&Value::Null, true), "{state:#}");
    place.say(&["call", "feeder.0", "off"]).ok();
    until("a line", || lines(&file).iter().any(|line| line == "is off"));
    launch.stop();

    let info = info(&file).unwrap();
    assert_eq!((info.is_closed, info.closed_because.as_deref()), (true, Some("ended")));
    for (topic, every) in TOPICS {
        assert_all_there(&file, topic, last(topic), every);
    }
    assert_eq!(info.session["node"], "main");
    assert!(info.configuration["test.toml"].contains("[record]"), "{:?}", info.configuration);
    let said = place.say(&["record", "info", file.to_str().unwrap()]).ok();
    assert_has(
        &said,
        ["feeder.0/frame", "{number: u64, bytes: ", "output.0/line", "drawn of output.0/line", "closed (ended)"],
    );
    let said = place.say(&["log", "--file", file.to_str().unwrap(), "--module", "feeder.0"]).ok();
    assert!(said.ends_with(" info  main/feeder.0: is off\n"), "{said}");
}

#[test]
fn a_recorder_that_is_killed_goes_on_and_makes_a_whole_file_of_what_it_had() {
    let (place, mut launch, robot) = launched(RECORD);
    let [torn, recovered, next] =
        ["main-0001", "main-0001.recovered", "main-0002"].map(|name| place.path(&format!("recordings/{name}.mcap")));
    feed_until_recorded(&place, "feeder.0");
    let before = feed(&place, "feeder.0", 200);
    let topics = ["feeder.0/count", "feeder.0/frame"];
    topics.iter().for_each(|topic| wait_for_all(&place, &torn, topic, before, 1));
    let known = accounts(&place);
    robot.kill("logd.0");
    feed_until_recorded(&place, "feeder.0");
    let last = feed(&place, "feeder.0", 200);
    topics.iter().for_each(|topic| wait_for_all(&place, &next, topic, last, 1));
    until("the first file is recovered", || recovered.exists());
    launch.stop();

    assert!(!is_closed(&torn).unwrap() && is_closed(&recovered).unwrap());
    assert_eq!(info(&next).unwrap().closed_because.as_deref(), Some("ended"));
    for topic in topics {
        let (written, _) = known[topic];
        let first = numbers(&recovered, topic);
        assert!(first.len() as u64 >= written && first.last() == Some(&before), "{topic}: {written} of {first:?}");
        let later = assert_all_there(&next, topic, last, 1);
        assert!(later[0] > before, "{topic}: {} behind {before}", later[0]);
    }
}

/// The ring keeps 512 records.
#[test]
fn what_was_written_while_the_recorder_was_away_is_taken_from_the_ring_or_counted() {
    let place = Place::new();
    let logd = LOGD.replace("stop-within", "restart = \"never\"\nstop-within");
    let (mut launch, robot) = launched_with(&place, &logd, RECORD);
    let topic = "feeder.0/frame";
    feed_until_recorded(&place, "feeder.0");
    let mut all = Vec::new();
    for (number, meanwhile, is_lost) in [(1, 100, false), (2, 700, true)] {
        let [file, next] = [number, number + 1].map(|at| place.path(&format!("recordings/main-{at:04}.mcap")));
        let before = feed(&place, "feeder.0", 50);
        until("all is written", || numbers(&file, topic).last() == Some(&before));
        let pid = robot.pid("logd.0");
        signal(pid, Signal::SIGKILL);
        until("it is gone", || robot.process("logd.0").is_none());
        let last = feed(&place, "feeder.0", meanwhile);
        place.say(&["start", "logd.0"]).ok();
        wait("what came meanwhile is written", || (numbers(&next, topic).last()? >= &last).then_some(()));
        all.extend(numbers(&file, topic));
        let page = call(&place, "logd.0", &["channels", "0"]);
        let channel = page["channels"].as_array().unwrap().iter().find(|channel| channel["topic"] == topic).unwrap();
        let away = channel["lost_by"]["away"].as_u64().unwrap();
        let began = numbers(&next, topic)[0];
        assert_eq!((began - before - 1, away > 0), (away, is_lost), "{channel}");
        assert_eq!(channel["lost"], away, "{channel}");
    }
    launch.stop();
    assert!(all.is_sorted_by(|a, b| a < b), "nothing is recorded twice: {all:?}");
    let told = info(&place.path("recordings/main-0003.mcap")).unwrap();
    assert!(told.is_closed && told.losses[LossCause::Away] >= 700 - 512, "{told:?}");
}

#[test]
fn a_folder_that_is_not_there_is_told_and_recording_begins_as_soon_as_it_is() {
    let (place, mut launch, robot) = launched(&RECORD.replace("\"recordings\"", "\"disk/recordings\""));
    let errors = || place.say(&["log", "--timeout", "60", "--level", "error"]).out;
    let told = wait("an error", || Some(errors()).filter(|lines| lines.contains("records nothing: ")));
    assert!(told.contains("/disk/recordings") && told.contains(": is gone; make the folder again"), "{told}");
    assert!(told.contains("tries again every second (errno 2: No such file or directory)"), "{told}");
    let shown = |tool: &str| {
        let all = place.say(&[tool, "--json"]).json();
        let lines = all.as_array().or_else(|| all["modules"].as_array()).unwrap();
        let line = lines.iter().find(|line| line["module"] == "logd.0").unwrap();
        (line["state"].as_str().unwrap().to_owned(), line["error"].as_str().unwrap_or_default().to_owned())
    };
    for tool in ["status", "list"] {
        until(format!("{tool} says that nothing is recorded"), || {
            let (state, error) = shown(tool);
            state == "on" && error.starts_with("records nothing: ") && error.contains("is gone")
        });
    }
    let frames = StreamId { name: robot.name("feeder.0"), number: FeedingInterface::FRAME.number };
    wait("the recorder has subscribed", || {
        let status = place.say(&["status", "feeder.0", "--json"]).json();
        let readers = robot.node.inspect_stream(frames).unwrap()?.readers;
        (status[0]["subscribers"] == 1 && readers == 1).then_some(())
    });
    // Nobody else notices, and what comes meanwhile waits in memory.
    feed(&place, "feeder.0", 100);
    assert_eq!(place.say(&["status", "feeder.0", "--json"]).json()[0]["missed"], 0);
    assert!(call(&place, "logd.0", &["recording"])["file"].is_null());
    std::fs::create_dir_all(place.path("disk/recordings")).unwrap();
    let file = place.path("disk/recordings/main-0001.mcap");
    for topic in ["feeder.0/count", "feeder.0/frame"] {
        wait_for_all(&place, &file, topic, 100, 1);
    }
    until("a line", || lines(&file).iter().any(|line| line.starts_with("records again; ")));
    for tool in ["status", "list"] {
        until(format!("{tool} says that all is well"), || shown(tool) == ("on".into(), String::new()));
    }
    launch.stop();
    for topic in ["feeder.0/count", "feeder.0/frame"] {
        assert_eq!(numbers(&file, topic), (1..=100).collect::<Vec<u64>>(), "{topic}");
    }
}

#[test]
fn the_example_of_the_book_is_right() {
    let page = include_str!("../../docs/src/recording.md");
    let example = page.split("```toml\n[classes]\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let (class, modules) = example.split_once("\n\n").unwrap();
    let demo = include_str!("../../config/demo.toml").replacen("[nodes.main]", &format!("{class}\n\n[nodes.main]"), 1);
    let place = Place::new();
    place.write("demo.toml", format!("{demo}\n{modules}"));
    place.copy("config/building.map");
    place.say(&["check", "demo.toml"]).ok_with(["\nRecording\n"]);
}
