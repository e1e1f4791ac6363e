//! The demo is recorded beside a loop on each processor: no entry of a journal and nothing short is lost, losses of
//! pictures have their cause, and modules repeat exactly what they did.
//!
//! For a long run: `ROHRPOST_BUSY_SECONDS=20 cargo test -p rohrpost-cli --test e2e recorded_busy`.

use crate::harness::{Place, json_lines, times};
use crate::load::Load;
use crate::recordings::messages;
use rohrpost_recording::info;
use std::collections::BTreeMap;
use std::path::Path;

const SECONDS: &str = "ROHRPOST_BUSY_SECONDS";
/// Longer ones are pictures.
const SHORT_BYTES: usize = 64 << 10;

/// The longest message of each topic.
fn longest(file: &Path) -> BTreeMap<String, usize> {
    let mut longest: BTreeMap<String, usize> = BTreeMap::new();
    for (topic, bytes) in messages(file, |channel, message| Some((channel.topic.to_string(), message.data.len()))) {
        let most = longest.entry(topic).or_default();
        *most = bytes.max(*most);
    }
    longest
}

#[test]
fn beside_a_loop_on_each_processor_nothing_short_is_lost_and_modules_repeat_exactly() {
    let seconds = times(SECONDS, 5).to_string();
    let place = Place::new();
    let load = Load::begin();
    let said = place.say(&["demo", "--no-gui", "--quiet", "--seconds", &seconds, "--record", "out.mcap"]);
    drop(load);
    assert!(!said.err.contains("did not stop within"), "{}", said.err);
    said.ok();
    let file = place.path("out.mcap");
    let (told, longest) = (info(&file).unwrap(), longest(&file));
    assert_eq!(told.closed_because.as_deref(), Some("ended"), "{told:?}");
    assert!(told.channels.iter().any(|channel| channel.topic.ends_with("/journal")), "{told:?}");
    for channel in &told.channels {
        let is_short = longest.get(channel.topic.as_str()).is_some_and(|bytes| *bytes <= SHORT_BYTES);
        assert!(channel.lost == 0 || !is_short, "{channel:?}");
        assert_eq!(channel.losses.all(), channel.lost, "each loss has its cause: {channel:?}");
    }
    let said = place.say(&["replay", "--exact", "--run-recorded", "--json", "out.mcap"]).out;
    let runs = json_lines(&said);
    assert!(!runs.is_empty() && runs.iter().all(|run| run["result"] == "identical"), "{runs:#?}");
    println!("{}: {} messages, lost: {}", file.display(), told.messages, told.losses.text());
    place.assert_empty();
}
