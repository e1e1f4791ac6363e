//! A file begins with the newest message of each channel, and nothing takes that for a second one.

use super::support::{channel, channel_of, files, memory_folder, noise, options, session, until};
use crate::{ChannelId, Cue, Message, Options, Player, Reader, Rotation, Selection, Writer, cut, info, merge};
use rohrpost_schema::{Field, Members, Named, Type};
use std::path::{Path, PathBuf};

const SECOND_NS: u64 = 1_000_000_000;
/// What is true now, but for the arrival: topic, stamp, epoch, sequence.
pub(super) type Kept = (String, u64, u64, u32);

/// A line of output, as far as this crate looks at it.
fn line() -> Type {
    let level = Type::Enum { name: "OutputLevel".into(), text: String::new(), variants: Vec::new() };
    let fields = [("module", Type::U32), ("level", level), ("text", Type::Text)];
    let fields = fields.map(|(name, ty)| Field::new(name, ty));
    Type::Struct(Named::new("OutputLine", Members::Fields(fields.into())))
}

struct Recording {
    writer: Writer,
    channels: [ChannelId; 3],
    arrival_ns: u64,
    sequence: u32,
}

const MAP: usize = 0;
const SCAN: usize = 1;
const LINE: usize = 2;
/// Two of them are more than a file takes.
const FILLER_BYTES: usize = 200_000;

impl Recording {
    fn begin(folder: &Path) -> Self {
        let rotation = Rotation { bytes_max: 300_000, ..Rotation::default() };
        let mut writer = Writer::start(Options { rotation, ..options(folder) }, session()).unwrap();
        let items = [("mapper.0", "map", Type::Bytes), ("laser.0", "scan", Type::Bytes), ("output.0", "line", line())];
        let channels = items.map(|(name, item, ty)| channel_of(&mut writer, name, item, &ty));
        Self { writer, channels, arrival_ns: 5 * SECOND_NS, sequence: 0 }
    }

    /// One message a tenth of a second later.
    fn say(&mut self, channel: usize, epoch: u64, data: &[u8]) {
        self.arrival_ns += SECOND_NS / 10;
        self.sequence += 1;
        let (arrival_ns, sequence) = (self.arrival_ns, self.sequence);
        let message = Message { arrival_ns, stamp_ns: arrival_ns - 7, epoch, sequence, data };
        self.writer.write(self.channels[channel], &message).unwrap();
    }

    fn wait_until_written(&self) {
        until("all is written", || self.writer.status().written >= u64::from(self.sequence));
    }

    /// A long line, alone in its chunk: the second one begins the next file.
    fn fill(&mut self, epoch: u64) {
        self.wait_until_written();
        self.say(LINE, epoch, &noise(self.sequence, FILLER_BYTES));
        self.wait_until_written();
    }
}

/// Three files: a map and a line in the first, scans in the second, another map in the third.
pub(super) fn three_files(folder: &Path) -> Vec<PathBuf> {
    let mut recording = Recording::begin(folder);
    recording.say(MAP, 1, b"old map");
    recording.say(MAP, 1, b"first map");
    recording.say(LINE, 1, b"is on");
    // More than a second.
    (0..20).for_each(|_| recording.say(SCAN, 1, &[3; 100]));
    recording.fill(1);
    recording.fill(1);
    (0..5).for_each(|_| recording.say(SCAN, 1, &[3; 100]));
    recording.fill(1);
    recording.say(MAP, 1, b"second map");
    let (status, told) = recording.writer.finish();
    told.unwrap();
    assert_eq!((status.written, status.lost), (u64::from(recording.sequence), 0), "{status:?}");
    let files = files(folder);
    assert_eq!(files.len(), 3, "{files:?}");
    files
}

/// The scan of a number.
fn scan(number: u32) -> Kept {
    ("laser.0/scan".into(), 5 * SECOND_NS + u64::from(number) * SECOND_NS / 10 - 7, 1, number)
}

/// Numbers of the messages that files do not repeat, without lines.
fn numbers(files: &[PathBuf]) -> Vec<u32> {
    let mut numbers = Vec::new();
    for file in files {
        let mut reader = Reader::open(file).unwrap();
        while let Some((channel, message)) = reader.next().unwrap() {
            if !channel.is_repeated() && channel.name != "output.0" {
                numbers.push(message.sequence);
            }
        }
    }
    numbers
}

/// What a file repeats, with its log time and bytes; and the first message behind that.
pub(super) fn beginning(path: &Path) -> (Vec<(Kept, u64, Vec<u8>)>, u64) {
    let mut reader = Reader::open(path).unwrap();
    let mut repeated = Vec::new();
    while let Some((channel, message)) = reader.next().unwrap() {
        if !channel.is_repeated() {
            return (repeated, message.arrival_ns);
        }
        let Message { arrival_ns, stamp_ns, epoch, sequence, data } = message;
        repeated.push(((channel.topic.to_string(), stamp_ns, epoch, sequence), arrival_ns, data.to_vec()));
    }
    panic!("nothing but repetitions in {}", path.display());
}

/// Numbers of what is played, without lines.
fn played(files: &[PathBuf], from_ns: u64) -> Vec<u32> {
    let mut player = Player::new(files.to_vec(), |channel| channel.topic != "output.0/line");
    assert!(player.seek(from_ns).unwrap());
    let mut sequences = Vec::new();
    loop {
        match player.poll(u64::MAX).unwrap() {
            Cue::Message(_, message) => sequences.push(message.sequence),
            Cue::End => return sequences,
            Cue::Begin { .. } | Cue::Wait { .. } | Cue::Busy => {}
        }
    }
}

#[test]
fn each_file_begins_with_the_newest_of_what_does_not_come_at_once() {
    let folder = memory_folder();
    let files = three_files(folder.path());
    assert_eq!(beginning(&files[0]).0, [], "nothing came before");
    let map: Kept = ("mapper.0/map".into(), 5 * SECOND_NS + SECOND_NS / 5 - 7, 1, 2);
    // The scan came a fifth of a second before the second file, and six tenths before the third.
    for (file, number) in [(&files[1], 23), (&files[2], 30)] {
        let (repeated, first_ns) = beginning(file);
        let scan = (scan(number), first_ns, vec![3; 100]);
        assert_eq!(repeated, [(map.clone(), first_ns, b"first map".to_vec()), scan], "no lines");
        let told = info(file).unwrap();
        assert_eq!((told.repeated, told.first_ns), (2, Some(first_ns)));
        let of = |topic: &str| told.channels.iter().find(|its| its.topic == topic).unwrap();
        assert_eq!((of("mapper.0/map").repeated, of("laser.0/scan").repeated), (1, 1));
    }
    let told: Vec<_> = files.iter().map(|file| info(file).unwrap()).collect();
    let maps = |at: usize| told[at].channels.iter().find(|its| its.topic == "mapper.0/map").unwrap();
    assert_eq!([maps(0).messages, maps(1).messages, maps(2).messages], [2, 0, 1], "each is counted once");
    assert_eq!(maps(1).first_ns, None);
    assert_eq!(told.iter().map(|its| its.messages).sum::<u64>(), 2 + 1 + 20 + 2 + 5 + 1 + 1);
}

#[test]
fn a_replay_has_what_its_first_file_repeats_and_nothing_twice() {
    let folder = memory_folder();
    let files = three_files(folder.path());
    assert_eq!(played(&files, 0), numbers(&files));
    let later = numbers(&files[1..]);
    assert_eq!(played(&files[1..], 0), [&[2, 23], &later[..]].concat(), "the map is there from the beginning");
    let (_, first_ns) = beginning(&files[1]);
    assert_eq!(played(&files, first_ns + 1), [&[2, 23], &later[..]].concat(), "and wherever it begins");
}

#[test]
fn merged_files_repeat_nothing_that_is_there() {
    let folder = memory_folder();
    let files = three_files(folder.path());
    let all: u64 = files.iter().map(|file| info(file).unwrap().messages).sum();
    let to = folder.path().join("all.merged");
    let (messages, _) = merge(&files, &to, &mut |_, _| {}).unwrap();
    let told = info(&to).unwrap();
    assert_eq!((messages, told.messages, told.repeated), (all, all, 0));
    let to = folder.path().join("rest.merged");
    let (messages, _) = merge(&files[1..], &to, &mut |_, _| {}).unwrap();
    let told = info(&to).unwrap();
    let first = info(&files[0]).unwrap().messages;
    assert_eq!((messages, told.messages, told.repeated), (all - first, all - first, 2));
    assert_eq!(beginning(&to), beginning(&files[1]));
}

#[test]
fn a_part_keeps_the_mark() {
    let folder = memory_folder();
    let files = three_files(folder.path());
    let to = folder.path().join("part.cut");
    let selection = Selection { names: vec!["mapper.0".into()], ..Selection::default() };
    assert_eq!(cut(&files[1], &to, &selection, &mut |_, _| {}).unwrap().0, 0, "it is no message of its own");
    let told = info(&to).unwrap();
    assert_eq!((told.messages, told.repeated, told.channels.len()), (0, 1, 1));
}

#[test]
fn a_part_from_the_middle_begins_with_what_was_true_there() {
    let folder = memory_folder();
    let files = three_files(folder.path());
    let first_ns = 5 * SECOND_NS;
    let to = |name: &str| folder.path().join(format!("{name}.cut"));
    let from = |from_ns: u64| Selection { from_ns: Some(from_ns), ..Selection::default() };
    // Maps came 0.1 and 0.2 s after that, scans from 0.4 s to 2.3 s.
    cut(&files[0], &to("late"), &from(first_ns + SECOND_NS * 2), &mut |_, _| {}).unwrap();
    let map: Kept = ("mapper.0/map".into(), first_ns + SECOND_NS / 5 - 7, 1, 2);
    let begin_ns = first_ns + SECOND_NS * 2;
    let map_at = |begin_ns: u64| (map.clone(), begin_ns, b"first map".to_vec());
    let scan_at = |number: u32, begin_ns: u64| (scan(number), begin_ns, vec![3; 100]);
    assert_eq!(beginning(&to("late")), (vec![map_at(begin_ns), scan_at(19, begin_ns)], begin_ns));
    let begin_ns = first_ns + SECOND_NS;
    cut(&files[0], &to("early"), &from(begin_ns), &mut |_, _| {}).unwrap();
    assert_eq!(beginning(&to("early")), (vec![map_at(begin_ns), scan_at(9, begin_ns)], begin_ns), "however new");
    // What is repeated in a file is repeated in its parts, also in those that begin soon behind its beginning.
    let (_, second_ns) = beginning(&files[1]);
    cut(&files[1], &to("soon"), &from(second_ns + 1), &mut |_, _| {}).unwrap();
    let begin_ns = second_ns + SECOND_NS / 10;
    assert_eq!(beginning(&to("soon")), (vec![map_at(begin_ns), scan_at(23, begin_ns)], begin_ns));
    cut(&files[1], &to("second"), &from(second_ns + SECOND_NS * 2), &mut |_, _| {}).unwrap();
    let told = info(&to("second")).unwrap();
    assert_eq!((told.messages, told.repeated), (0, 2), "nothing is left but the map and a scan");
    let names = Selection { names: vec!["laser.0".into()], ..from(first_ns + SECOND_NS * 2) };
    cut(&files[0], &to("named"), &names, &mut |_, _| {}).unwrap();
    assert_eq!(beginning(&to("named")).0, [scan_at(19, first_ns + SECOND_NS * 2)], "the map is not selected");
}

#[test]
fn after_a_step_of_time_all_is_repeated_in_its_own_epoch() {
    let folder = memory_folder();
    let mut recording = Recording::begin(folder.path());
    recording.say(MAP, 1, b"map");
    recording.say(SCAN, 1, b"scan");
    recording.fill(1);
    recording.arrival_ns = SECOND_NS;
    recording.fill(2);
    recording.writer.finish().1.unwrap();
    let files = files(folder.path());
    let (repeated, first_ns) = beginning(&files[1]);
    let kept: Vec<_> = repeated.iter().map(|((topic, _, epoch, _), log_ns, _)| (&topic[..], *epoch, *log_ns)).collect();
    assert_eq!(kept, [("mapper.0/map", 1, first_ns), ("laser.0/scan", 1, first_ns)]);
    assert_eq!(info(&files[1]).unwrap().epochs.iter().map(|its| its.epoch).collect::<Vec<_>>(), [2]);
}

#[test]
fn a_recording_begins_with_what_came_before_it_in_another_one_and_since_then() {
    let folder = memory_folder();
    let mut recording = Recording::begin(folder.path());
    recording.say(MAP, 1, b"map");
    recording.say(SCAN, 1, b"old scan");
    recording.say(LINE, 1, b"is on");
    let Recording { mut writer, channels, arrival_ns, .. } = recording;
    let late = |number: u32, data: &'static [u8]| {
        let arrival_ns = arrival_ns + u64::from(number) * 2 * SECOND_NS;
        Message { arrival_ns, stamp_ns: arrival_ns, epoch: 1, sequence: number, data }
    };
    // It comes while the recording ends.
    let mut earlier = writer.passed_over();
    earlier.note(channels[SCAN], &late(10, b"scan"));
    earlier.note(channels[LINE], &late(11, b"is off"));
    earlier.fill(writer.take_newest().unwrap());
    assert!(writer.take_newest().is_none());
    writer.finish().1.unwrap();
    earlier.note(channels[SCAN], &late(12, b"newest scan"));

    // Channels have other numbers there, and one has another type.
    let mut writer = Writer::start_behind(Some(earlier), options(folder.path()), session()).unwrap();
    let others = [("pilot.0", "goal", Type::Bytes), ("laser.0", "scan", Type::Bytes), ("mapper.0", "map", Type::Text)];
    let [goal, ..] = others.map(|(name, item, ty)| channel_of(&mut writer, name, item, &ty));
    writer.write(goal, &late(20, b"go")).unwrap();
    let newest = writer.take_newest();
    writer.finish().1.unwrap();
    let (repeated, first_ns) = beginning(&folder.path().join("base-0002.mcap"));
    let Message { stamp_ns, .. } = late(12, b"");
    assert_eq!(repeated, [(("laser.0/scan".to_owned(), stamp_ns, 1, 12), first_ns, b"newest scan".to_vec())]);

    // And again, though nothing came of it in between.
    let mut writer = Writer::start_behind(newest, options(folder.path()), session()).unwrap();
    let [scan, goal] = [("laser.0", "scan"), ("pilot.0", "goal")].map(|(name, item)| channel(&mut writer, name, item));
    assert_ne!(scan, goal);
    writer.write(goal, &late(30, b"stop")).unwrap();
    writer.finish().1.unwrap();
    let numbers: Vec<u32> = beginning(&folder.path().join("base-0003.mcap")).0.iter().map(|its| its.0.3).collect();
    assert_eq!(numbers, [12, 20]);
}
