//! What a recording may ask of the computer on which it is replayed.

use super::*;
use clap::Parser;
use rohrpost::interface::Interface;
use rohrpost::interfaces::LaserInterface;
use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};
use std::collections::BTreeMap;

/// A stream of 6 GiB.
const GREEDY: &str = r#"
installation = "test"
[system]
name = "robot"
id = 1
[classes]
laser = { id = 100 }
tool = { id = 16 }
[nodes.main]
[[module]]
name = "laser.0"
program = "laser"
[module.stream.scan]
record = "64 MiB"
keep = 60000
"#;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    arguments: Arguments,
}

/// A recording with this configuration, and a scan.
fn recorded(folder: &Path) -> PathBuf {
    let configuration = BTreeMap::from([("robot.toml".to_owned(), GREEDY.to_owned())]);
    let session = Session { configuration, ..Session::default() };
    let mut writer = Writer::start(Options { leave_bytes: 0, ..Options::new(folder, "base") }, session).unwrap();
    let description = LaserInterface::description();
    for name in ["laser.0", "laser.1"] {
        writer.describe(name, &description).unwrap();
    }
    let item = description.data_item("scan").unwrap();
    let spec = ChannelSpec { name: "laser.0", item: "scan", ty: &item.field.ty, texts: BTreeMap::new() };
    let channel = writer.channel(&spec).unwrap();
    writer.write(channel, &Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence: 0, data: &[] }).unwrap();
    writer.finish().1.unwrap();
    folder.join("base-0001.mcap")
}

#[test]
fn a_recording_gets_no_shared_memory_without_bound_unless_the_user_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let config = folder.path().join("own.toml");
    std::fs::write(&config, GREEDY).unwrap();
    let made = |more: &[&str]| {
        let line = ["rohrpost", file.to_str().unwrap(), "--no-gui"].into_iter().chain(more.iter().copied());
        let arguments = Line::parse_from(line).arguments;
        let recorded = RecordedFiles::read(&arguments.files).unwrap();
        let own = tempfile::tempdir().unwrap();
        installation(&arguments, &recorded, own.path()).map(|made| made.installation.memory_on(NODE))
    };
    let told = made(&[]).map_err(|error| error.to_string()).unwrap_err();
    // For two lasers of the kind of which the configuration has one.
    assert!(told.starts_with("the recorded configuration asks for 7501."), "{told}");
    assert!(told.ends_with("name a configuration of your own: --config FILE"), "{told}");
    assert!(made(&["--config", config.to_str().unwrap()]).unwrap() > 3 << 40);
}
