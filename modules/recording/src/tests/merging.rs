//! Files are merged by time of arrival.

use super::support::{Said, channel_of, cut_off, file_of, memory_folder, options, read, said, session};
use crate::{LossCause, MergeError, Message, Options, Writer, info, merge};
use rohrpost_schema::{Field, Members, Named, Type};

#[test]
fn messages_of_several_files_come_in_the_order_in_which_they_arrived() {
    let folder = memory_folder();
    let all = said(3_000, 700);
    let of = |node: usize| -> Vec<Said> {
        all.iter().enumerate().filter(|(at, _)| at * 7 / 10 % 3 == node).map(|(_, said)| said.clone()).collect()
    };
    let paths: Vec<_> = (0..3).map(|node| file_of(folder.path(), &format!("n{node}"), &of(node))).collect();
    let to = folder.path().join("merged.mcap");
    let (messages, bytes) = merge(&paths, &to, &mut |_, _| {}).unwrap();
    assert_eq!(read(&to), (all.clone(), 0));
    let told = info(&to).unwrap();
    assert_eq!((told.messages, told.bytes, told.channels.len()), (messages, bytes, 3));
    assert!(told.others.iter().any(|(name, texts)| name == "rohrpost.merged" && texts["0003"] == "n2-0001.mcap"));
}

#[test]
fn where_time_steps_back_each_files_order_stays() {
    let folder = memory_folder();
    let (mut one, mut other) = (said(100, 10), said(100, 10));
    for said in &mut one[50..] {
        (said.arrival_ns, said.epoch) = (said.arrival_ns - 400, 2);
    }
    other.iter_mut().for_each(|said| said.topic = said.topic.replace("laser", "motor"));
    let paths = [file_of(folder.path(), "a", &one), file_of(folder.path(), "b", &other)];
    let to = folder.path().join("merged.mcap");
    merge(&paths, &to, &mut |_, _| {}).unwrap();
    let (all, _) = read(&to);
    let (ones, others): (Vec<Said>, Vec<Said>) = all.into_iter().partition(|said| said.topic.starts_with("laser"));
    assert_eq!((ones, others), (one, other), "with their epochs");
    assert_eq!(info(&to).unwrap().epochs.iter().map(|its| its.messages).collect::<Vec<_>>(), [150, 50]);
}

/// A file of one message, with losses.
fn file_with(folder: &std::path::Path, stem: &str, ty: &Type, lost: u64) -> std::path::PathBuf {
    let mut writer = Writer::start(Options { stem: stem.into(), ..options(folder) }, session()).unwrap();
    let channel = channel_of(&mut writer, "motor.0", "state", ty);
    writer.write(channel, &Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence: 0, data: &[1] }).unwrap();
    writer.count_lost(channel, LossCause::Recorder, lost);
    writer.finish().1.unwrap();
    folder.join(format!("{stem}-0001.mcap"))
}

fn struct_of(ty: Type, text: &str) -> Type {
    Type::Struct(Named::new("State", Members::Fields(vec![Field::new("speed", ty).said(text, "")])))
}

#[test]
fn one_name_with_two_types_is_refused_and_losses_are_summed() {
    let folder = memory_folder();
    let one = file_with(folder.path(), "a", &struct_of(Type::U8, "How fast."), 3);
    let same = file_with(folder.path(), "b", &struct_of(Type::U8, "How fast it is."), 4);
    let other = file_with(folder.path(), "c", &struct_of(Type::F64, "How fast."), 0);
    let to = folder.path().join("merged.mcap");
    let error = merge(&[one.clone(), other], &to, &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, MergeError::OtherType { .. }));
    let said = error.to_string();
    assert!(said.contains("motor.0/state is {speed: u8} in") && said.contains("and {speed: f64} in"), "{said}");
    assert!(!to.exists());
    merge(&[one, same], &to, &mut |_, _| {}).unwrap();
    let told = info(&to).unwrap();
    assert_eq!((told.channels.len(), told.messages, told.lost, told.losses[LossCause::Recorder]), (1, 2, 7, 7));
}

#[test]
fn what_was_not_closed_is_not_merged() {
    let folder = memory_folder();
    let path = file_of(folder.path(), "a", &said(20, 10));
    cut_off(&path, 20);
    let to = folder.path().join("merged.mcap");
    let error = merge(&[path], &to, &mut |_, _| {}).unwrap_err();
    assert!(error.to_string().contains("was not closed") && error.to_string().contains("`recover`"), "{error}");
    assert!(matches!(merge(&[], &to, &mut |_, _| {}), Err(MergeError::Nothing)));
    assert!(!to.exists());
}
