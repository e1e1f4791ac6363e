//! Files that Python's writer makes, as rosbag2 and others pack them, are listed and cut.

use super::python;
use rohrpost_recording::{Info, Reader, Selection, cut, info, recover};
use std::path::{Path, PathBuf};

#[test]
fn files_of_others_are_listed_without_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let files = python("foreign.py", &[folder.path().to_owned()]);
    assert_eq!(files.len(), 5, "{files:?}");
    for file in files.iter().map(PathBuf::from) {
        check(&info(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display())), &file);
        check_torn(folder.path(), &file);
        let mut reader = Reader::open(&file).unwrap();
        let mut messages = 0;
        while let Some((_, message)) = reader.next().unwrap() {
            assert_eq!((message.data.len(), message.arrival_ns), (60, messages * 1_000));
            messages += 1;
        }
        assert!(messages == 300 && reader.is_closed(), "{}", file.display());
    }
    let part = folder.path().join("part.mcap");
    let selection = Selection { names: vec!["/state".into()], ..Selection::default() };
    assert_eq!(cut(&folder.path().join("lz4.mcap"), &part, &selection, &mut |_, _| {}).unwrap().0, 100);
    assert_eq!(python("read.py", &[part]), ["100 /state=100"]);
}

fn check(info: &Info, file: &Path) {
    let file = file.display();
    assert_eq!((info.messages, info.is_closed, info.profile.as_str()), (300, true, "ros2"), "{file}");
    assert_eq!((info.first_ns, info.last_ns), (Some(0), Some(299_000)), "{file}");
    let said = info.channels.iter().map(|channel| {
        let times = (channel.first_ns, channel.last_ns);
        format!(
            "{} {} {} {} {} {times:?}",
            channel.topic, channel.type_name, channel.schema_encoding, channel.message_encoding, channel.messages
        )
    });
    assert_eq!(
        said.collect::<Vec<_>>(),
        [
            "/imu sensor_msgs/msg/Imu ros2msg cdr 100 (Some(0), Some(297000))",
            "/pose foxglove.PoseInFrame protobuf protobuf 100 (Some(1000), Some(298000))",
            "/state State jsonschema json 100 (Some(2000), Some(299000))",
        ],
        "{file}"
    );
}

/// Without its end it is still listed, as far as it goes, and recovered so.
fn check_torn(folder: &Path, file: &Path) {
    let (torn, to) = (folder.join("torn.mcap"), folder.join("whole.mcap"));
    let bytes = std::fs::read(file).unwrap();
    std::fs::write(&torn, &bytes[..bytes.len() / 2]).unwrap();
    let told = info(&torn).unwrap();
    assert!(!told.is_closed && told.messages < 300, "{}: {told:?}", file.display());
    let recovered = recover(&torn, &to, &mut |_, _| {}).unwrap();
    assert_eq!(recovered.messages, told.messages, "{}", file.display());
    std::fs::remove_file(to).unwrap();
}
