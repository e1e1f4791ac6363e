//! What is written is read again, in the order in which it came.

use super::support::{
    Said, channel, channel_of, file_of, files, memory_folder, noise, options, read, record, said, until,
};
use crate::disk::RealDisk;
use crate::{
    ChannelError, ChannelSpec, DescribedModule, LossCause, Losses, Message, Options, Rotation, Selection, Session,
    StartError, WriteError, Writer, cut, info, merge, recover,
};
use proptest::prelude::*;
use rohrpost_schema::{DataItem, DataKind, Description, Field, Type};
use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::Duration;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn all_comes_back_in_order(
        steps in prop::collection::vec((0..4_u8, 0..200_u64, 0..3_u64, 0..4000_usize), 0..300),
    ) {
        let mut arrival_ns = 5_000;
        let mut sequences = [0_u32; 4];
        let one = |(channel, later, epoch, len): (u8, u64, u64, usize)| {
            arrival_ns += later;
            let sequence = &mut sequences[usize::from(channel)];
            *sequence += 1;
            let topic = format!("laser.{channel}/scan");
            let data = noise(*sequence, len);
            Said { topic, arrival_ns, stamp_ns: arrival_ns - later, epoch, sequence: *sequence, data }
        };
        let all: Vec<Said> = steps.into_iter().map(one).collect();
        let folder = memory_folder();
        let path = file_of(folder.path(), "base", &all);
        prop_assert_eq!(read(&path), (all.clone(), 0));
        let told = info(&path).unwrap();
        prop_assert!(told.is_closed && told.damages.is_empty());
        prop_assert_eq!(told.messages, all.len() as u64);
        for channel in &told.channels {
            let its: Vec<&Said> = all.iter().filter(|said| channel.topic == said.topic).collect();
            prop_assert_eq!(channel.messages, its.len() as u64);
            prop_assert_eq!(channel.first_ns, its.first().map(|said| said.arrival_ns));
            prop_assert_eq!(channel.last_ns, its.last().map(|said| said.arrival_ns));
        }
        for epoch in &told.epochs {
            prop_assert_eq!(epoch.messages, all.iter().filter(|said| said.epoch == epoch.epoch).count() as u64);
        }
    }
}

#[test]
fn a_file_is_for_its_user_alone_and_what_is_made_of_files_lets_in_nobody_else_than_all_of_them() {
    let folder = memory_folder();
    let mode = |path: &Path| path.metadata().unwrap().permissions().mode() & 0o777;
    let open = |stem: &str, mode| {
        let path = file_of(folder.path(), stem, &said(10, 20));
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        path
    };
    assert_eq!(mode(&file_of(folder.path(), "own", &said(10, 20))), 0o600);
    let for_group = Options { mode: 0o660, stem: "group".into(), ..options(folder.path()) };
    record(Box::new(RealDisk), for_group, &said(10, 20));
    assert_eq!(mode(&folder.path().join("group-0001.mcap")), 0o660, "whatever the umask says");
    let (group, all) = (open("a", 0o640), open("b", 0o664));
    let made = ["cut.mcap", "merged.mcap", "recovered.mcap"].map(|name| folder.path().join(name));
    cut(&all, &made[0], &Selection::default(), &mut |_, _| {}).unwrap();
    merge(&[group.clone(), all], &made[1], &mut |_, _| {}).unwrap();
    recover(&group, &made[2], &mut |_, _| {}).unwrap();
    assert_eq!(made.each_ref().map(|path| mode(path)), [0o664, 0o640, 0o640]);
}

#[test]
fn files_are_rotated_by_size_without_a_loss_and_each_stands_alone() {
    let folder = memory_folder();
    let all = said(4_000, 2_000);
    let rotation = Rotation { bytes_max: 3 << 20, ..Rotation::default() };
    let (status, refused) = record(Box::new(RealDisk), Options { rotation, ..options(folder.path()) }, &all);
    assert!(refused.is_empty() && status.lost == 0, "{status:?}");
    let files = files(folder.path());
    assert!(files.len() >= 3, "{files:?}");
    assert_eq!(status.files_closed, files.len() as u64);
    let mut found = Vec::new();
    for (number, path) in files.iter().enumerate() {
        let told = info(path).unwrap();
        assert!(told.bytes <= (3 << 20) + (64 << 10), "{}", told.bytes);
        assert_eq!((told.channels.len(), told.session["file"].to_string()), (3, (number + 1).to_string()));
        assert_eq!(told.session["node"], "base");
        assert_eq!(told.configuration["robot.toml"], "system = \"demo\"\n");
        assert!(told.channels.iter().all(|channel| channel.ty.as_deref() == Some(&Type::Bytes)));
        let is_last = number + 1 == files.len();
        assert_eq!(told.closed_because.as_deref(), Some(if is_last { "ended" } else { "rotated" }));
        found.extend(read(path).0);
    }
    assert_eq!(found, all);
    assert_eq!(status.bytes, files.iter().map(|path| path.metadata().unwrap().len()).sum::<u64>());
}

#[test]
fn files_are_rotated_by_time() {
    let folder = memory_folder();
    let rotation = Rotation { age_max: Duration::from_millis(20), ..Rotation::default() };
    let mut writer = Writer::start(Options { rotation, ..options(folder.path()) }, Session::default()).unwrap();
    let channel = channel_of(&mut writer, "motor.0", "speed", &Type::U8);
    let mut sequence = 0;
    while writer.status().files_closed < 3 {
        writer.write(channel, &message(sequence, &[1])).unwrap();
        sequence += 1;
        std::thread::sleep(Duration::from_millis(1));
    }
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!(status.written, u64::from(sequence));
    let all: Vec<u32> = files(folder.path()).iter().flat_map(|path| read(path).0).map(|said| said.sequence).collect();
    assert_eq!(all, (0..sequence).collect::<Vec<_>>());
}

fn message(sequence: u32, data: &[u8]) -> Message<'_> {
    Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence, data }
}

#[test]
fn a_chunk_is_a_megabyte_or_one_message() {
    let folder = memory_folder();
    let mut all = said(300, 10_000);
    all[100].data = noise(7, 5 << 20);
    let path = file_of(folder.path(), "base", &all);
    let mut frames = crate::read::frames::Frames::open(&path).unwrap();
    let index = crate::read::index::Index::read(&mut frames).unwrap();
    let sizes: Vec<u64> = index.chunks.iter().map(|chunk| chunk.uncompressed_size).collect();
    assert_eq!(sizes.iter().filter(|size| **size > 1 << 20).count(), 1, "{sizes:?}");
    assert_eq!(read(&path).0, all);
}

#[test]
fn a_message_that_is_too_long_is_lost_and_counted() {
    let folder = memory_folder();
    let mut writer = Writer::start(options(folder.path()), Session::default()).unwrap();
    let channel = channel(&mut writer, "camera.0", "image");
    let long = vec![0; (16 << 20) + 1];
    assert_eq!(writer.write(channel, &message(0, &long)), Err(WriteError::Long(long.len())));
    writer.write(channel, &message(1, &long[1..])).unwrap();
    writer.count_lost(channel, LossCause::Recorder, 41);
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.written, status.lost), (1, 42));
    let told = info(&files(folder.path())[0]).unwrap();
    assert_eq!((told.messages, told.lost, told.channels[0].lost), (1, 42, 42));
    let of = |losses: Losses| (losses[LossCause::Long], losses[LossCause::Recorder], losses.all());
    assert_eq!(
        (of(status.losses), of(told.losses), of(told.channels[0].losses)),
        ((1, 41, 42), (1, 41, 42), (1, 41, 42))
    );
}

#[test]
fn one_name_has_one_type() {
    let folder = memory_folder();
    let mut writer = Writer::start(options(folder.path()), Session::default()).unwrap();
    let spec = |ty| ChannelSpec { name: "motor.0", item: "speed", ty, texts: BTreeMap::new() };
    let first = writer.channel(&spec(&Type::U8)).unwrap();
    assert_eq!(writer.channel(&spec(&Type::U8)), Ok(first));
    let error = writer.channel(&spec(&Type::F64)).unwrap_err();
    assert!(matches!(error, ChannelError::OtherType { .. }));
    assert_eq!(
        error.to_string(),
        "motor.0/speed is recorded with type u8 already, not f64; end the recording and begin another"
    );
}

#[test]
fn a_stem_cannot_lead_elsewhere() {
    for stem in ["", ".hidden", "../up", "a/b", "a\nb"] {
        let told = Writer::start(Options::new("/tmp", stem), Session::default());
        assert!(matches!(told, Err(StartError::Stem(_))), "{stem:?}");
    }
}

#[test]
fn nothing_is_overwritten() {
    let folder = memory_folder();
    let first = file_of(folder.path(), "base", &said(3, 10));
    let before = std::fs::read(&first).unwrap();
    record(Box::new(RealDisk), options(folder.path()), &said(5, 10));
    assert_eq!(std::fs::read(&first).unwrap(), before);
    let files = files(folder.path());
    assert_eq!(files.len(), 2);
    assert_eq!(read(&files[1]).0.len(), 5);
}

#[test]
fn losses_are_told_also_of_a_channel_without_messages() {
    let folder = memory_folder();
    let mut writer = Writer::start(options(folder.path()), Session::default()).unwrap();
    let channel = channel(&mut writer, "camera.0", "image");
    writer.count_lost(channel, LossCause::Recorder, 7);
    writer.finish().1.unwrap();
    let told = info(&files(folder.path())[0]).unwrap();
    assert_eq!((told.messages, told.lost, told.channels[0].topic.as_str()), (0, 7, "camera.0/image"));
}

fn described(class: &str) -> Description {
    let field = Field::new("speed", Type::U8).said("", "m/s");
    let data = vec![DataItem { number: 1, kind: DataKind::Data, field }];
    Description { name: "Speed".into(), class: class.into(), text: String::new(), functions: Vec::new(), data }
}

#[test]
fn modules_are_described_in_each_file_and_in_what_is_made_of_it() {
    let folder = memory_folder();
    let rotation = Rotation { bytes_max: 1 << 20, ..Rotation::default() };
    let mut writer = Writer::start(Options { rotation, ..options(folder.path()) }, Session::default()).unwrap();
    let channel = channel_of(&mut writer, "motor.0", "speed", &Type::U8);
    let modules = ["motor.0", "pump.3"].map(|name| {
        let description = described(&name[..name.len() - 2]);
        writer.describe(name, &description).unwrap();
        DescribedModule { name: name.into(), description }
    });
    assert_eq!(writer.describe("motor.0", &modules[0].description), Ok(()));
    let other = writer.describe("motor.0", &described("wheel")).unwrap_err();
    assert!(other.to_string().contains("is recorded with interface"), "{other}");
    for sequence in 0..400 {
        writer.write(channel, &message(sequence, &noise(sequence, 10_000))).unwrap();
    }
    until("what waits is written", || writer.status().waiting == 0);
    let late = DescribedModule { name: "late.0".into(), description: described("late") };
    writer.describe("late.0", &late.description).unwrap();
    writer.finish().1.unwrap();
    let paths = files(folder.path());
    assert!(paths.len() >= 3, "{paths:?}");
    for path in &paths[..paths.len() - 1] {
        assert_eq!(info(path).unwrap().described, modules, "{path:?}");
    }
    let last = paths.last().unwrap();
    let [motor, pump] = modules;
    let all = [motor, pump, late];
    assert_eq!(info(last).unwrap().described, all, "also what came last");
    let made = ["cut", "merged", "recovered"].map(|name| folder.path().join(format!("{name}.mcap")));
    cut(last, &made[0], &Selection::default(), &mut |_, _| {}).unwrap();
    merge(&paths, &made[1], &mut |_, _| {}).unwrap();
    recover(last, &made[2], &mut |_, _| {}).unwrap();
    for path in made {
        assert_eq!(info(&path).unwrap().described, all, "{path:?}: once, from whichever file");
    }
    let identities: Vec<String> =
        paths.iter().map(|path| info(path).unwrap().session["recording"].to_string()).collect();
    assert!(identities.iter().all(|identity| *identity == identities[0]), "{identities:?}");
}
