//! Files as rosbag2 and Foxglove write them, in whole and in part: nothing of them is lost, and Python's reader finds
//! all of it in what is made of them.

use super::python;
use rohrpost_recording::{Cue, Player, Selection, cut, info, merge, recover};
use std::path::{Path, PathBuf};

/// Each of a bag's two topics, and half of the other file's.
const MESSAGES: u64 = 100;

/// When messages are played.
fn played(path: &Path) -> Vec<u64> {
    let mut player = Player::new(vec![path.to_owned()], |_| true);
    let mut all = Vec::new();
    loop {
        match player.poll(u64::MAX).unwrap_or_else(|error| panic!("{}: {error}", path.display())) {
            Cue::Message(_, message) => all.push(message.arrival_ns),
            Cue::End => return all,
            Cue::Begin { .. } | Cue::Wait { .. } | Cue::Busy => {}
        }
    }
}

#[test]
fn files_of_rosbag2_and_foxglove_are_read_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = python("bags.py", &[folder.path().to_owned()]).into_iter().map(PathBuf::from).collect();
    let [plain, packed, foxglove] = &files[..] else { panic!("{files:?}") };
    let by_topic = "200 /scan=100 /text=100";
    for (path, topics, theirs) in [
        (plain, by_topic, "ros2; ; "),
        (packed, by_topic, "ros2; ; "),
        (foxglove, "200 /scan=200", "; calib.yaml text/yaml 495; device {'name': 'theirs'}"),
    ] {
        let name = path.display();
        assert_eq!(python("read.py", std::slice::from_ref(path)), [topics], "{name}");
        assert!(python("kept.py", std::slice::from_ref(path))[0].starts_with(theirs), "{name}");
        let told = info(path).unwrap();
        assert_eq!((told.messages, told.is_closed, told.channels.len()), (2 * MESSAGES, true, 2), "{name}: {told:?}");
        assert_eq!((told.first_ns, told.attachments.len()), (Some(0), usize::from(path == foxglove)), "{name}");
        let times = played(path);
        assert!(times.is_sorted() && times.len() as u64 == 2 * MESSAGES, "{name}: {times:?}");

        let made = ["part", "merged", "whole"].map(|made| path.with_extension(format!("{made}.mcap")));
        let [part, merged, whole] = &made;
        cut(path, part, &Selection::default(), &mut |_, _| {}).unwrap();
        merge(std::slice::from_ref(path), merged, &mut |_, _| {}).unwrap();
        assert_eq!(recover(path, whole, &mut |_, _| {}).unwrap().damages, [], "{name}");
        assert_eq!(python("read.py", &made), [topics; 3], "{name}");
        let kept = python("kept.py", &made);
        assert!(
            kept == vec![kept[0].clone(); 3] && kept[0] == python("kept.py", std::slice::from_ref(path))[0],
            "{kept:?}"
        );
        for made in &made {
            assert_eq!(played(made), times, "{}", made.display());
            assert_eq!(info(made).unwrap().profile, told.profile, "{}", made.display());
        }
    }
}
