//! The trial of a bundle, as the disk remembers it: what counts as failed, and where the node goes then.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{CONFIGURATION, PROGRAM, Workshop, current, push};
use rohrpost_bundle::{Begun, Bundle, NodeFolder, NodeFolderError, Programs, Trial};
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};

#[track_caller]
fn launch(node: &NodeFolder, bundle: &Bundle) -> Trial {
    match Trial::begin(node, bundle.digest()).unwrap() {
        Begun::Launch(mut trial) => {
            trial.start().unwrap();
            trial
        }
        back => panic!("{back:?}"),
    }
}

fn state(node: &NodeFolder) -> String {
    node.report().unwrap().trial
}

/// A node with version 1, which has passed its trial, and version 2, which is current and has not.
fn node_in_trial(workshop: &Workshop) -> (NodeFolder, [Bundle; 2]) {
    let node = workshop.node("node");
    let [first, second] = ["one", "two"].map(|says| workshop.make(says));
    push(&node, &first).unwrap();
    let mut trial = launch(&node, &first);
    assert!(trial.is_under_way());
    trial.pass().unwrap();
    assert!(!trial.is_under_way() && state(&node) == "passed");
    drop(trial);
    push(&node, &second).unwrap();
    assert_eq!(state(&node), "due");
    (node, [first, second])
}

#[test]
fn a_bundle_that_passed_has_no_further_trial() {
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    launch(&node, &second).pass().unwrap();
    // Killed without a word: that is no failure any more.
    drop(launch(&node, &second));
    let mut trial = launch(&node, &second);
    assert!(!trial.is_under_way());
    trial.interrupt().unwrap();
    assert_eq!((current(&node), state(&node)), (2, "passed".into()));
}

#[test]
fn a_failed_trial_goes_back_and_so_does_one_without_an_end() {
    for is_killed in [false, true] {
        let workshop = Workshop::new();
        let (node, [first, second]) = node_in_trial(&workshop);
        let mut trial = launch(&node, &second);
        assert_eq!(state(&node), "running", "the disk says so before anything starts");
        if is_killed {
            drop(trial);
            assert!(matches!(Trial::begin(&node, second.digest()).unwrap(), Begun::Back(2, 1)));
        } else {
            assert_eq!(trial.fail().unwrap(), Some((2, 1)));
            drop(trial);
        }
        assert_eq!((current(&node), state(&node)), (1, "passed".into()));
        assert!(!launch(&node, &first).is_under_way());
        let report = node.report().unwrap();
        assert_eq!(report.before, [0; 0], "the failed one is not before the first");
        // It may be tried again, if a person wants it.
        assert!(push(&node, &second).unwrap().is_new);
        assert!(launch(&node, &second).is_under_way());
    }
}

#[test]
fn a_way_back_that_was_cut_between_its_steps_is_completed() {
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    assert_eq!(launch(&node, &second).fail().unwrap(), Some((2, 1)));
    // What is remembered was written, and the link was not.
    let link = node.path().join("current");
    fs::remove_file(&link).unwrap();
    symlink(format!("bundles/{}", second.digest()), &link).unwrap();
    assert_eq!((current(&node), state(&node)), (2, "failed".into()));
    assert!(matches!(Trial::begin(&node, second.digest()).unwrap(), Begun::Back(2, 1)));
    assert_eq!(current(&node), 1);
}

#[test]
fn the_way_back_leads_to_the_nearest_bundle_that_is_whole() {
    for (damaged, ends_at) in [(0, 2), (1, 1), (2, 3)] {
        let workshop = Workshop::new();
        let (node, _) = node_in_trial(&workshop);
        launch(&node, &node.bundle().unwrap()).pass().unwrap();
        let third = workshop.make("three");
        let folder = |version: u64| {
            let bundles = fs::read_dir(node.path().join("bundles")).unwrap().map(|entry| entry.unwrap().path());
            bundles.into_iter().find(|path| Bundle::open(path).unwrap().manifest().version() == version).unwrap()
        };
        push(&node, &third).unwrap();
        // The nearest ones: what modules have written beside the files is no damage.
        fs::write(folder(2).join("written"), "").unwrap();
        (3 - damaged..3).for_each(|version| fs::write(folder(version).join(PROGRAM), "echo evil").unwrap());
        let back = (ends_at < 3).then_some((3, ends_at));
        assert_eq!(launch(&node, &third).fail().unwrap(), back, "{damaged} are damaged");
        assert_eq!(node.report().unwrap().version, ends_at);
        assert_eq!(
            launch(&node, &node.bundle().unwrap()).is_under_way(),
            back.is_none(),
            "a failed one is tried again"
        );
    }
}

#[test]
fn a_launch_that_has_not_started_a_module_may_be_killed() {
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    for _ in 0..2 {
        let Begun::Launch(trial) = Trial::begin(&node, second.digest()).unwrap() else { panic!("back") };
        assert!(trial.is_under_way() && state(&node) == "due");
        drop(trial);
    }
    let mut changed = launch(&node, &second);
    changed.interrupt().unwrap();
    changed.leave_due();
    assert!(!changed.is_under_way());
    drop(changed);
    let mut beside = Trial::beside(&node, second.digest()).unwrap();
    assert!(!beside.is_under_way());
    beside.start().unwrap();
    assert_eq!((current(&node), state(&node)), (2, "due".into()));
}

#[test]
fn a_state_that_is_locked_for_long_does_not_hold_launch_up() {
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    let mut trial = launch(&node, &second);
    let lock = fs::File::open(node.path().join("state.lock")).unwrap();
    assert_eq!(lock.metadata().unwrap().permissions().mode() & 0o777, 0o600, "no other user may hold it");
    lock.lock().unwrap();
    assert!(matches!(trial.pass(), Err(NodeFolderError::Busy(_))));
    assert!(matches!(trial.fail(), Err(NodeFolderError::Busy(_))));
    assert!(trial.is_under_way() && state(&node) == "running");
    lock.unlock().unwrap();
    assert_eq!(trial.fail().unwrap(), Some((2, 1)));
}

#[test]
fn a_launch_that_is_told_to_stop_leaves_the_trial_due() {
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    for _ in 0..3 {
        launch(&node, &second).interrupt().unwrap();
        assert_eq!((current(&node), state(&node)), (2, "due".into()));
    }
}

#[test]
fn without_a_bundle_before_a_failed_one_stays_and_is_tried_again() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let bundle = workshop.make("one");
    push(&node, &bundle).unwrap();
    assert_eq!(launch(&node, &bundle).fail().unwrap(), None);
    assert_eq!((current(&node), state(&node)), (1, "failed".into()));
    drop(launch(&node, &bundle));
    drop(launch(&node, &bundle));
    launch(&node, &bundle).pass().unwrap();
    assert_eq!(state(&node), "passed");
}

#[test]
fn one_launch_at_a_time_and_only_the_current_bundle_is_tried() {
    let workshop = Workshop::new();
    let (node, [first, second]) = node_in_trial(&workshop);
    let running = launch(&node, &second);
    assert!(matches!(Trial::begin(&node, second.digest()), Err(NodeFolderError::Launched(_))));
    drop(running);
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    node.back().unwrap();
    assert!(!launch(&node, &second).is_under_way(), "a person has named it");
    assert_eq!(current(&node), 1);
    drop(first);
}

#[test]
fn a_newer_bundle_that_came_meanwhile_stays() {
    let workshop = Workshop::new();
    let (node, [_, second]) = node_in_trial(&workshop);
    let mut trial = launch(&node, &second);
    push(&node, &workshop.make("three")).unwrap();
    assert_eq!(trial.fail().unwrap(), None);
    assert_eq!((current(&node), state(&node)), (3, "due".into()));
}

#[test]
fn programs_are_checked_again_when_they_changed() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    push(&node, &workshop.make("one")).unwrap();
    let bundle = node.bundle().unwrap();
    let programs = Programs::of(&bundle);
    let program = bundle.folder().join(PROGRAM);
    let right = fs::read(&program).unwrap();
    programs.permit(&program).unwrap();
    programs.permit(&node.path().join("current").join(PROGRAM)).unwrap();
    programs.permit("/bin/sh".as_ref()).unwrap();
    // As long as before, at the time of before.
    let written = fs::metadata(&program).unwrap().modified().unwrap();
    let evil: Vec<u8> = right.iter().map(|byte| byte ^ 1).collect();
    fs::write(&program, evil).unwrap();
    fs::File::options().write(true).open(&program).unwrap().set_modified(written).unwrap();
    assert!(programs.permit(&program).unwrap_err().to_string().starts_with("it was changed: its digest"));
    fs::write(&program, &right).unwrap();
    programs.permit(&program).unwrap();
    fs::remove_file(&program).unwrap();
    assert!(programs.permit(&program).is_err());
    let further = bundle.folder().join("bin/further");
    fs::write(&further, "").unwrap();
    fs::set_permissions(&further, PermissionsExt::from_mode(0o755)).unwrap();
    assert!(programs.permit(&further).unwrap_err().to_string().contains("does not have it"));
    // A link to a program outside, in place of the program, then of its folder.
    let outside = workshop.path("outside");
    fs::create_dir(&outside).unwrap();
    fs::copy(&further, outside.join("pilot")).unwrap();
    symlink(outside.join("pilot"), &program).unwrap();
    for way in [&program, &node.path().join("current/maps/..").join(PROGRAM)] {
        assert!(programs.permit(way).unwrap_err().to_string().contains("it is a link"), "{}", way.display());
    }
    fs::remove_dir_all(program.parent().unwrap()).unwrap();
    symlink(&outside, program.parent().unwrap()).unwrap();
    assert!(programs.permit(&program).unwrap_err().to_string().contains("lies behind one"));
}

#[test]
fn a_link_in_place_of_the_configuration_lies_in_the_bundle() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    push(&node, &workshop.make("one")).unwrap();
    let (bundle, outside) = (node.bundle().unwrap(), workshop.path("outside"));
    let place = bundle.folder().canonicalize().unwrap().join(CONFIGURATION);
    fs::rename(&place, &outside).unwrap();
    symlink(&outside, &place).unwrap();
    symlink(node.path(), workshop.path("link")).unwrap();
    for given in ["node/current/robot.toml", "link/current/maps/../robot.toml", "link/current/../../outside"] {
        let found = NodeFolder::containing(&workshop.path(given)).unwrap();
        let is_inside = given.ends_with("robot.toml");
        assert_eq!(found.map(|(_, _, file)| file), is_inside.then(|| place.clone()), "{given}");
    }
    assert_eq!(bundle.differences().unwrap()[0].to_string(), "robot.toml is no regular file");
}
