//! A recorder hears modules of other nodes, over a network that loses packages: what is lost is counted.

use crate::harness::{OUTPUT, Place, RECORDED_CLASSES, until};
use crate::network::{NETWORK, at, launched_all, nodes};
use crate::recorded::{feed, feed_until_recorded, feeder_entry, lines, number};
use crate::recordings::messages_so_far;
use rohrpost_recording::{Message, info};
use std::path::Path;
use std::time::Duration;

const LOGD: &str = r#"
[[module]]
name = "logd.0"
node = "base"
builtin = "logd"
stop-within = "60 s"
[module.mailbox.data]
slots = 512
size = "12 KiB"
[record]
directory = "recordings"
streams = ["*"]
data = ["*", "feeder.0/frame"] # a stream on the other node; its records fit a package
output = "info"
leave-free = "0 B"
flush = "20 ms"
"#;

/// For so long after its start a server refuses commands that are sent again, with something to spare.
const REPEATS_REFUSED: Duration = Duration::from_secs(3);

/// Numbers of packages and of the values in them.
pub(crate) fn values(file: &Path, topic: &str) -> Vec<(u32, u64)> {
    let value = |message: &Message<'_>| (message.sequence, number(topic, message.data));
    messages_so_far(file, |channel, message| (channel.topic == topic).then(|| value(message)))
}

/// Feeds until one that was sent after `target` values is in the file: all before it are there, or known to be missing.
fn feed_beyond(place: &Place, file: &Path, topic: &str, target: u64) {
    until(format!("{topic} is recorded up to {target}"), || {
        feed(place, "feeder.0", 1);
        values(file, topic).last().is_some_and(|(_, number)| *number >= target)
    });
}

#[test]
fn data_and_output_of_another_node_are_recorded_or_counted() {
    let place = Place::new();
    let modules = [at("base", OUTPUT), at("arm", &feeder_entry(0)), LOGD.to_owned()];
    let config = place.config_of(
        "test",
        &nodes([("base", "10.77.0.1"), ("arm", "10.77.0.2")]),
        &[&RECORDED_CLASSES, NETWORK, &modules.concat()],
    );
    let bad = ["--impair", "loss=2%,delay=1ms,reorder=5%,seed=11"];
    let Some(mut launch) = launched_all(&place, &config, &["base", "arm"], &bad) else { return };
    // A repeat that comes in a server's first seconds is refused: it cannot know whether one before it ran the command.
    std::thread::sleep(REPEATS_REFUSED);
    let file = place.path("recordings/base-0001.mcap");
    let topics = ["feeder.0/count", "feeder.0/frame"];
    feed_until_recorded(&place, "feeder.0");
    let target = feed(&place, "feeder.0", 300);
    topics.iter().for_each(|topic| feed_beyond(&place, &file, topic, target));
    // A line may be lost; the next one says so.
    until("a line of the other node", || {
        ["off", "on"].iter().for_each(|word| drop(place.say(&["call", "feeder.0", word]).ok()));
        lines(&file).iter().any(|line| line == "is off")
    });
    launch.stop();

    let told = info(&file).unwrap();
    assert_eq!(told.closed_because.as_deref(), Some("ended"));
    for topic in topics {
        let values = values(&file, topic);
        let ((first, first_number), (last, _)) = (values[0], values[values.len() - 1]);
        assert!(values.is_sorted_by(|a, b| a.0 < b.0), "{topic}: {values:?}");
        let is_numbered = |(package, number): &(u32, u64)| number - first_number == u64::from(package - first);
        assert!(values.iter().all(is_numbered), "{topic}: each value has a package of its own: {values:?}");
        let channel = told.channels.iter().find(|channel| channel.topic == topic).unwrap();
        assert_eq!(values.len() as u64 + channel.lost, u64::from(last) + 1, "{topic}: each is there or counted");
    }
    let lost: u64 = told.channels.iter().map(|channel| channel.lost).sum();
    assert!(lost > 0, "2 % of some thousand datagrams: {told:?}");
    let said = place.say(&["log", "--file", file.to_str().unwrap(), "--module", "feeder.0"]).out;
    assert!(said.contains(" info  arm/feeder.0: is off\n"), "{said}");
    place.assert_empty();
}
