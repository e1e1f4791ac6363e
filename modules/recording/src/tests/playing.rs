//! A replay has the recording's order and spacing, whatever the time does.

use super::support::{Said, cut_off, file_of, files, memory_folder, options, record, said};
use crate::disk::RealDisk;
use crate::{Cue, Options, Player, Reader, Rotation};
use std::path::{Path, PathBuf};

/// What a replay did.
#[derive(Debug, PartialEq, Eq)]
enum Did {
    Begun { system_ns: u64, epoch: u64 },
    Played { at_ns: u64, topic: String, sequence: u32 },
}

/// Plays to the end, with a time that passes by `step_ns` wherever the player waits. Without what is older than the
/// place where it begins.
fn play(player: &mut Player, step_ns: u64) -> Vec<Did> {
    let (mut now_ns, mut did) = (0, Vec::new());
    loop {
        match player.poll(now_ns).unwrap() {
            Cue::Begin { system_ns, epoch } => {
                now_ns = system_ns;
                did.push(Did::Begun { system_ns, epoch });
            }
            Cue::Message(channel, _) if channel.is_repeated() => {}
            Cue::Message(channel, message) => {
                let (topic, sequence) = (channel.topic.to_string(), message.sequence);
                did.push(Did::Played { at_ns: now_ns, topic, sequence });
            }
            Cue::Wait { until_ns } => {
                assert!(until_ns > now_ns, "a wait of nothing");
                now_ns += step_ns;
            }
            Cue::Busy => {}
            Cue::End => return did,
        }
    }
}

/// The same, as a recording tells it: a message is played at the first step of the time that is not before its arrival.
fn course(all: &[Said], step_ns: u64) -> Vec<Did> {
    course_from(all.first().map_or(0, |said| said.arrival_ns), all, step_ns)
}

/// The same, if time begins there.
fn course_from(begin_ns: u64, all: &[Said], step_ns: u64) -> Vec<Did> {
    let (mut time, mut did) = (None::<(u64, u64)>, Vec::new());
    if let Some(first) = all.first() {
        time = Some((begin_ns, first.epoch));
        did.push(Did::Begun { system_ns: begin_ns, epoch: first.epoch });
    }
    for said in all {
        if time.is_none_or(|(_, epoch)| said.epoch > epoch) {
            time = Some((said.arrival_ns, said.epoch));
            did.push(Did::Begun { system_ns: said.arrival_ns, epoch: said.epoch });
        }
        let (now_ns, epoch) = time.unwrap();
        let is_late = said.epoch < epoch || said.arrival_ns <= now_ns;
        let at_ns = if is_late { now_ns } else { now_ns + (said.arrival_ns - now_ns).div_ceil(step_ns) * step_ns };
        time = Some((at_ns, epoch));
        did.push(Did::Played { at_ns, topic: said.topic.clone(), sequence: said.sequence });
    }
    did
}

/// Of one recording.
fn two_files(folder: &Path, all: &[Said]) -> Vec<PathBuf> {
    let rotation = Rotation { bytes_max: 3 << 20, ..Rotation::default() };
    let (status, refused) = record(Box::new(RealDisk), Options { rotation, ..options(folder) }, all);
    assert!(refused.is_empty() && status.files_closed == 2, "{status:?}");
    files(folder)
}

/// Messages of 700 B, several chunks of them, with a step of time back, which one channel learns of later.
fn with_a_step() -> Vec<Said> {
    let mut all = said(6_000, 700);
    for said in &mut all[4_000..] {
        (said.arrival_ns, said.epoch) = (said.arrival_ns - 30_000, 2);
    }
    all[4_001].epoch = 1;
    all
}

#[test]
fn messages_are_played_in_order_when_they_are_due_and_time_steps_where_it_stepped() {
    let (folder, all) = (memory_folder(), with_a_step());
    let files = two_files(folder.path(), &all);
    for step_ns in [1, 7, 10, 1_000] {
        let did = play(&mut Player::new(files.clone(), |_| true), step_ns);
        assert!(did == course(&all, step_ns), "by steps of {step_ns} ns");
    }
}

#[test]
fn what_is_not_chosen_is_left_out() {
    let (folder, all) = (memory_folder(), with_a_step());
    let files = two_files(folder.path(), &all);
    let chosen: Vec<Said> = all.into_iter().filter(|said| said.topic == "laser.1/scan").collect();
    let did = play(&mut Player::new(files.clone(), |channel| channel.name == "laser.1"), 10);
    assert!(did == course(&chosen, 10));
    assert_eq!(play(&mut Player::new(files, |_| false), 10), []);
}

#[test]
fn a_replay_goes_on_at_any_time_of_any_file() {
    let (folder, all) = (memory_folder(), with_a_step());
    let mut player = Player::new(two_files(folder.path(), &all), |_| true);
    let last_ns = all.iter().map(|said| said.arrival_ns).max().unwrap();
    for at_ns in [0, 1_000, 1_001, 20_995, 31_000, 31_001, 40_989, last_ns] {
        let first = all.iter().position(|said| said.arrival_ns >= at_ns).unwrap();
        assert!(player.seek(at_ns).unwrap());
        let wanted = course_from(at_ns.max(1_000), &all[first..], 1_000);
        assert!(play(&mut player, 1_000) == wanted, "from {at_ns} on");
    }
    assert!(!player.seek(last_ns + 1).unwrap());
    assert!(matches!(player.poll(0).unwrap(), Cue::End));
}

#[test]
fn a_file_without_an_index_is_searched_from_its_beginning() {
    let (folder, all) = (memory_folder(), said(6_000, 700));
    let path = file_of(folder.path(), "a", &all);
    cut_off(&path, 20);
    let mut reader = Reader::open(&path).unwrap();
    for number in [5_000, 10] {
        assert!(reader.seek(all[100].arrival_ns).unwrap());
        assert!(reader.seek(all[number].arrival_ns).unwrap(), "what was found before is forgotten");
        assert_eq!(reader.next().unwrap().unwrap().1.data, all[number].data);
        assert_eq!(reader.next().unwrap().unwrap().1.data, all[number + 1].data);
    }
}

#[test]
fn behind_damage_a_replay_goes_on() {
    let (folder, all) = (memory_folder(), said(6_000, 700));
    let files = two_files(folder.path(), &all);
    let mut bytes = std::fs::read(&files[0]).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    std::fs::write(&files[0], bytes).unwrap();
    let mut player = Player::new(files, |_| true);
    let (mut played, mut errors) = (0, 0);
    loop {
        match player.poll(u64::MAX) {
            Ok(Cue::Message(..)) => played += 1,
            Ok(Cue::End) => break,
            Ok(_) => {}
            Err(error) => {
                assert!(error.to_string().contains("damaged at byte"), "{error}");
                errors += 1;
            }
        }
    }
    assert!(errors == 1 && (3_000..6_000).contains(&played), "{played} of 6000, {errors} errors");
}

/// As after a reboot: epochs begin anew, at a later time.
#[test]
fn where_another_recording_begins_time_begins_anew() {
    let (folder, all) = (memory_folder(), said(60, 10));
    for (epoch, later_ns) in [(1, 1_000_000), (1, 0), (0, 1_000_000)] {
        let mut second = all.clone();
        for said in &mut second {
            (said.arrival_ns, said.epoch) = (said.arrival_ns + later_ns, epoch);
        }
        let stem = |which| format!("{which}-{epoch}-{later_ns}");
        let files = vec![file_of(folder.path(), &stem("a"), &all), file_of(folder.path(), &stem("b"), &second)];
        let both = course(&all, 10).into_iter().chain(course(&second, 10));
        let did = play(&mut Player::new(files, |_| true), 10);
        assert!(did == both.collect::<Vec<_>>(), "epoch {epoch}, {later_ns} ns later: {did:?}");
    }
}

#[test]
fn a_poll_passes_over_no_more_than_it_may() {
    let (folder, all) = (memory_folder(), said(6_000, 700));
    let files = two_files(folder.path(), &all);
    let mut player = Player::new(files, |_| false);
    let mut polls = 1;
    while let Cue::Busy = player.poll(0).unwrap() {
        polls += 1;
    }
    // 4.4 MB, a quarter of a MiB at a time.
    assert!((16..=18).contains(&polls), "{polls}");
    assert!(matches!(player.poll(0).unwrap(), Cue::End));
}
