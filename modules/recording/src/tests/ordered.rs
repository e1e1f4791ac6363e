//! Marks and other files, asked for while it records: at their place among the messages, and with an answer.

use super::disks::Faults;
use super::support::{channel, cut_off, files, memory_folder, options, said, session, until};
use crate::read::contents::{Contents, Item};
use crate::{
    ChannelId, DiskError, FileChange, Mark, Message, OrderError, PendingOrder, Selection, Session, Writer, cut, info,
    merge, recover, recovered_path,
};
use std::path::{Path, PathBuf};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

fn started(folder: &Path) -> (Writer, ChannelId) {
    let mut writer = Writer::start(options(folder), session()).unwrap();
    let channel = channel(&mut writer, "laser.0", "scan");
    (writer, channel)
}

/// The messages of these numbers, one each 10 ns.
fn write(writer: &mut Writer, channel: ChannelId, numbers: std::ops::Range<u32>) {
    for sequence in numbers {
        let ns = at(sequence);
        writer.write(channel, &Message { arrival_ns: ns, stamp_ns: ns, epoch: 1, sequence, data: &[7] }).unwrap();
    }
}

fn at(number: u32) -> u64 {
    1_000 + u64::from(number) * 10
}

fn mark(number: u32, text: &str) -> Mark {
    Mark { time_ns: at(number), epoch: 1, text: text.into() }
}

fn done(pending: Result<PendingOrder, OrderError>) -> FileChange {
    pending.unwrap().wait(PATIENCE).expect("in time").unwrap()
}

/// Numbers of messages, and texts of marks, in the order of the file.
fn content(path: &Path) -> Vec<String> {
    let (mut contents, mut all) = (Contents::open(path).unwrap(), Vec::new());
    while let Some(item) = contents.next().unwrap() {
        match item {
            Item::Message(found) => all.push(found.header.sequence.to_string()),
            Item::Metadata(its) if its.name == crate::format::metadata::MARK => all.push(its.metadata["text"].clone()),
            Item::Metadata(_) | Item::Attachment(_) => {}
            Item::Damaged(at, damage) => panic!("{}: {at}: {damage}", path.display()),
        }
    }
    all
}

#[test]
fn marks_stand_at_their_place_among_the_messages_and_survive_recover_cut_and_merge() {
    let folder = memory_folder();
    let (mut writer, channel) = started(folder.path());
    write(&mut writer, channel, 0..3);
    let first = writer.mark(mark(3, "door open"));
    write(&mut writer, channel, 3..5);
    assert_eq!(done(first), FileChange { closed: None, file: folder.path().join("base-0001.mcap") });
    done(writer.mark(mark(5, "T\u{fc}r zu")));
    for (text, words) in [("", "write what happened"), ("a\nb", "control character"), (&"x".repeat(501), "501 bytes")] {
        let refused = writer.mark(mark(0, text)).err().unwrap().to_string();
        assert!(refused.contains(words), "{refused}");
    }
    writer.finish().1.unwrap();
    let path = files(folder.path()).remove(0);
    let wanted = ["0", "1", "2", "door open", "3", "4", "T\u{fc}r zu"];
    assert_eq!(content(&path), wanted);
    let marks = vec![mark(3, "door open"), mark(5, "T\u{fc}r zu")];
    assert_eq!(info(&path).unwrap().marks, marks);

    let torn = folder.path().join("torn.mcap");
    std::fs::copy(&path, &torn).unwrap();
    cut_off(&torn, 20);
    assert_eq!(info(&torn).unwrap().marks, marks);
    recover(&torn, &recovered_path(&torn), &mut |_, _| {}).unwrap();
    assert_eq!(content(&recovered_path(&torn)), wanted);
    let part = folder.path().join("part.mcap");
    let selection = Selection { from_ns: Some(at(1)), until_ns: Some(at(4)), ..Selection::default() };
    cut(&path, &part, &selection, &mut |_, _| {}).unwrap();
    assert_eq!(info(&part).unwrap().marks, marks[..1], "the other one is behind the part");
    let all = folder.path().join("all.mcap");
    merge(&[path, part], &all, &mut |_, _| {}).unwrap();
    assert_eq!(info(&all).unwrap().marks.len(), 3);
}

#[test]
fn a_file_is_closed_and_the_next_begun_behind_the_messages_so_far() {
    let folder = memory_folder();
    let (mut writer, channel) = started(folder.path());
    let path = |number: u32| folder.path().join(format!("base-000{number}.mcap"));
    assert_eq!(done(writer.rotate()), FileChange { closed: None, file: path(1) }, "nothing is in it");
    write(&mut writer, channel, 0..3);
    let rotated = writer.rotate();
    write(&mut writer, channel, 3..5);
    assert_eq!(done(rotated), FileChange { closed: Some(path(1)), file: path(2) });
    done(writer.mark(mark(5, "alone")));
    assert_eq!(done(writer.rotate()), FileChange { closed: Some(path(2)), file: path(3) });
    done(writer.mark(mark(6, "only a mark")));
    assert_eq!(done(writer.rotate()), FileChange { closed: Some(path(3)), file: path(4) });
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.files_closed, status.files_torn, status.written), (4, 0, 5));
    let all: Vec<_> = files(folder.path()).iter().map(|path| content(path)).collect();
    assert_eq!(all, [vec!["0", "1", "2"], vec!["3", "4", "alone"], vec!["only a mark"], vec![]]);
    assert_eq!(info(&path(1)).unwrap().closed_because.as_deref(), Some("rotated"));
}

#[test]
fn it_goes_on_in_another_folder_and_stays_if_that_takes_no_file() {
    let folder = memory_folder();
    let other = folder.path().join("other");
    let (mut writer, channel) = started(folder.path());
    write(&mut writer, channel, 0..2);
    let refused = writer.move_to(other.clone()).unwrap().wait(PATIENCE).unwrap();
    assert!(matches!(refused, Err(OrderError::Disk(DiskError::Gone { .. }))), "{refused:?}");
    assert!(writer.status().problem.is_none(), "{:?}", writer.status());
    write(&mut writer, channel, 2..3);
    std::fs::create_dir(&other).unwrap();
    let moved = done(writer.move_to(other.clone()));
    let first = folder.path().join("base-0001.mcap");
    assert_eq!(moved.closed, Some(first.clone()));
    assert_eq!(moved.file.parent(), Some(&*other));
    write(&mut writer, channel, 3..4);
    assert_eq!(done(writer.rotate()).closed, Some(moved.file.clone()));
    // The one that has nothing is not kept.
    let back = done(writer.move_to(folder.path().to_owned()));
    assert_eq!((back.closed, back.file.parent()), (None, Some(folder.path())));
    writer.finish().1.unwrap();
    assert_eq!(content(&first), ["0", "1", "2"]);
    assert_eq!(files(&other), std::slice::from_ref(&moved.file));
    assert_eq!(content(&moved.file), ["3"]);
}

#[test]
fn a_folder_that_becomes_a_link_leads_nowhere() {
    let folder = memory_folder();
    let (root, away) = (folder.path().join("root"), folder.path().join("away"));
    let there = root.join("there");
    [&root, &there, &away].iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
    let options = crate::Options { root: Some(root.clone()), ..options(&root) };
    let mut writer = Writer::start(options, session()).unwrap();
    done(writer.move_to(there.clone()));
    done(writer.mark(mark(1, "inside")));
    std::fs::rename(&there, root.join("before")).unwrap();
    std::os::unix::fs::symlink(&away, &there).unwrap();
    let refused = writer.rotate().unwrap().wait(PATIENCE).unwrap();
    assert!(matches!(refused, Err(OrderError::Disk(DiskError::Outside { .. }))), "{refused:?}");
    let refused = writer.move_to(away.clone()).unwrap().wait(PATIENCE).unwrap();
    assert!(matches!(refused, Err(OrderError::Disk(DiskError::Outside { .. }))), "{refused:?}");
    std::fs::remove_file(&there).unwrap();
    std::fs::create_dir(&there).unwrap();
    // Tried again all the time; or the order comes before that.
    assert_eq!(done(writer.move_to(root.clone())).file.parent(), Some(&*root));
    writer.finish().1.unwrap();
    assert!(files(&away).is_empty());
}

/// What waits while the disk fails comes to the folder that it is told instead.
#[test]
fn another_folder_helps_while_the_disk_fails() {
    let folder = memory_folder();
    let (gone, there) = (folder.path().join("gone"), folder.path().join("there"));
    std::fs::create_dir(&there).unwrap();
    let mut writer = Writer::start(options(&gone), session()).unwrap();
    let channel = channel(&mut writer, "laser.0", "scan");
    write(&mut writer, channel, 0..5);
    until("the problem is told", || writer.status().problem.is_some());
    let marked = writer.mark(mark(5, "kept for later"));
    let moved = done(writer.move_to(there.clone()));
    assert_eq!((moved.closed, moved.file.parent()), (None, Some(&*there)));
    assert_eq!(done(marked).file, moved.file);
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.written, status.lost), (5, 0));
    assert_eq!(content(&moved.file), ["0", "1", "2", "3", "4", "kept for later"]);
}

#[test]
fn orders_behind_the_end_and_too_many_of_them_are_refused() {
    let folder = memory_folder();
    let gone = folder.path().join("gone");
    let mut writer = Writer::start(options(&gone), session()).unwrap();
    until("the problem is told", || writer.status().problem.is_some());
    let mut waiting: Vec<PendingOrder> = (0..16).map(|_| writer.rotate().unwrap()).collect();
    assert!(matches!(writer.rotate(), Err(OrderError::Full)));
    writer.begin_end();
    assert!(matches!(writer.mark(mark(1, "late")), Err(OrderError::Ended)));
    let told: Vec<_> = waiting.drain(..).map(|pending| pending.wait(PATIENCE).unwrap()).collect();
    assert!(told.iter().all(Result::is_err), "{told:?}");
    until("it has ended", || !writer.status().is_running);
    assert!(writer.finish().1.is_err());
}

/// Whatever fails: an order is answered, and what is told is true.
#[test]
fn orders_on_a_failing_disk_are_answered_and_no_message_is_lost_uncounted() {
    for seed in 0..40_u64 {
        let faults = Faults { create: 100, write: [50, 200][seed as usize % 2], sync: 100, free: 20 };
        let folder = memory_folder();
        let all = said(600, 500);
        let options = crate::Options { retry: Duration::from_millis(1), ..options(folder.path()) };
        let mut writer = Writer::start_on(faults.disk(seed), options, Session::default()).unwrap();
        let channel = channel(&mut writer, "laser.0", "scan");
        let mut orders = Vec::new();
        for (number, one) in all.iter().enumerate() {
            let message = Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: number as u32, data: &one.data };
            writer.write(channel, &message).unwrap();
            if number % 50 == 0 {
                orders.push((None, writer.rotate()));
                orders.push((Some(number.to_string()), writer.mark(mark(1, &number.to_string()))));
            }
        }
        let orders: Vec<(_, PendingOrder)> =
            orders.into_iter().filter_map(|(text, pending)| Some((text, pending.ok()?))).collect();
        let status = writer.finish().0;
        let (marks, messages) = kept(folder.path());
        assert_eq!(messages, status.written, "seed {seed}: {status:?}");
        assert_eq!(status.written + status.lost, 600, "seed {seed}: {status:?}");
        for (text, pending) in orders {
            let told = pending.wait(PATIENCE).expect("an answer");
            if let (Some(text), Ok(_)) = (&text, &told) {
                assert!(marks.contains(text), "seed {seed}: {text} was told to be set, and there are {marks:?}");
            }
        }
    }
}

/// Texts of all marks, and the number of all messages.
fn kept(folder: &Path) -> (Vec<String>, u64) {
    let (mut marks, mut messages) = (Vec::new(), 0);
    for path in files(folder) {
        let to: PathBuf = recovered_path(&path);
        messages += recover(&path, &to, &mut |_, _| {}).unwrap().messages;
        marks.extend(info(&to).unwrap().marks.into_iter().map(|mark| mark.text.to_string()));
    }
    (marks, messages)
}
