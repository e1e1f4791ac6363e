//! What a node takes, and what it refuses; whatever comes, its current bundle is whole.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{CONFIGURATION, MAP, PROGRAM, Workshop, current, push};
use rohrpost_bundle::{
    Bundle, FileEntry, FilePath, FolderSource, Ingredient, KeyError, MakeError, Manifest, NodeFolder, NodeFolderError,
    ReceiveError, Recipe, Sha256, Signature, SigningKey, Source, StreamSource, Trial, make, send,
};
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// Names in a folder of a node.
fn names(node: &NodeFolder, folder: &str) -> Vec<String> {
    let entries = fs::read_dir(node.path().join(folder)).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_node_has_what_was_made_and_three_versions_of_it() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let mut made = Vec::new();
    for version in 1..=5 {
        let bundle = workshop.make(&format!("version {version}"));
        let received = push(&node, &bundle).unwrap();
        // The program alone is new.
        let files_sent = if version == 1 { 3 } else { 1 };
        assert_eq!((received.version, received.is_new, received.files_sent), (version, true, files_sent));
        assert_eq!(received.configuration, node.path().join("current").join(CONFIGURATION));
        assert_eq!(current(&node), version);
        made.push(bundle.digest().to_string());
    }
    let mut kept = made.split_off(2);
    kept.sort();
    assert_eq!((names(&node, "bundles"), names(&node, "staging")), (kept, Vec::new()));
    let program = node.path().join("current").join(PROGRAM);
    assert_eq!(fs::read_to_string(&program).unwrap(), "echo version 5");
    assert_eq!(fs::metadata(&program).unwrap().permissions().mode() & 0o777, 0o755);
    assert_eq!(fs::metadata(node.path().join("current").join(MAP)).unwrap().permissions().mode() & 0o777, 0o644);
    assert_eq!(node.report().unwrap().before, [4, 3]);
    for version in [4, 3] {
        assert_eq!(node.back().unwrap(), (version + 1, version));
        assert_eq!(current(&node), version);
    }
    assert!(matches!(node.back(), Err(NodeFolderError::NothingBefore(3))));
}

#[test]
fn a_flipped_bit_in_any_byte_of_a_bundle_keeps_it_out() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let bundle = workshop.make("one");
    let is_refused = || {
        // Files that came before would not be asked again.
        let _ = fs::remove_dir_all(node.path().join("staging"));
        !matches!(Bundle::open(bundle.folder()).map(|bundle| push(&node, &bundle)), Ok(Ok(_)))
    };
    for name in [CONFIGURATION, PROGRAM, MAP, "manifest.toml", "manifest.sig"] {
        let path = bundle.folder().join(name);
        let right = fs::read(&path).unwrap();
        for at in 0..right.len() {
            let mut flipped = right.clone();
            flipped[at] ^= 1 << (at % 8);
            fs::write(&path, &flipped).unwrap();
            assert!(is_refused(), "{name}, byte {at}");
        }
        fs::write(&path, &right[..right.len() - 1]).unwrap();
        assert!(is_refused() && names(&node, "bundles").is_empty() && current(&node) == 0, "{name} cut");
        fs::write(&path, &right).unwrap();
    }
    push(&node, &bundle).unwrap();
    assert_eq!(current(&node), 1);
}

#[test]
fn unknown_keys_older_versions_and_other_robots_are_refused() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let bundles: Vec<Bundle> = ["one", "two", "three"].map(|says| workshop.make(says)).into();
    assert!(matches!(
        push(&NodeFolder::new(workshop.path("new")), &bundles[0]),
        Err(ReceiveError::Key(KeyError::NoneTrusted(_)))
    ));
    push(&node, &bundles[1]).unwrap();
    assert!(matches!(push(&node, &bundles[0]), Err(ReceiveError::Older { version: 1, newest: 2 })));
    push(&node, &bundles[2]).unwrap();
    node.back().unwrap();
    assert!(matches!(push(&node, &bundles[1]), Err(ReceiveError::Older { version: 2, newest: 3 })), "also after back");
    assert!(push(&node, &bundles[2]).unwrap().is_new, "the newest may come again");
    let said = workshop.make_for("test", "x", &workshop.path("others")).and_then(|_| {
        let second = workshop.make_for("test", "y", &workshop.path("others"))?;
        workshop.make_for("test", "z", &workshop.path("others")).map(|third| (second, third))
    });
    let (second, third) = said.unwrap();
    assert!(matches!(push(&node, &second), Err(ReceiveError::Older { .. })));
    assert!(matches!(push(&node, &third), Err(ReceiveError::SameVersion(3))));
    let far = workshop.path("far");
    let other = fourth(|| workshop.make_for("other-robot", "x", &far).unwrap());
    assert!(matches!(push(&node, &other), Err(ReceiveError::OtherInstallation { .. })));
    let stranger = Workshop::new();
    let strange = fourth(|| stranger.make("x"));
    let said = push(&node, &strange).unwrap_err().to_string();
    assert!(said.contains(&stranger.key.public().fingerprint()) && said.contains("none of those in"), "{said}");
    // Its signature with our key's name on it.
    let mut signature = strange.signature().text();
    signature.replace_range(8..72, &workshop.key.public().text()[8..72]);
    fs::write(strange.folder().join("manifest.sig"), signature).unwrap();
    let strange = Bundle::open(strange.folder()).unwrap();
    assert!(matches!(push(&node, &strange), Err(ReceiveError::Key(KeyError::Mismatch))));
    assert_eq!(current(&node), 3);
}

/// The last of four versions.
fn fourth(make: impl Fn() -> Bundle) -> Bundle {
    (0..3).for_each(|_| drop(make()));
    make()
}

#[test]
fn hostile_manifests_are_refused_even_if_they_are_signed() {
    struct Hostile(String, Signature);
    impl Source for Hostile {
        fn head(&mut self) -> io::Result<(Vec<u8>, Vec<u8>)> {
            Ok((self.0.clone().into_bytes(), self.1.text().into_bytes()))
        }
        fn want(&mut self, _: &[usize]) -> io::Result<()> {
            panic!("asked for files of\n{}", self.0);
        }
        fn file(&mut self, _: &FileEntry) -> io::Result<Box<dyn Read + '_>> {
            unreachable!()
        }
    }
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let text = Manifest::parse(workshop.make("x").manifest_bytes()).unwrap().text();
    let long = "x".repeat(600);
    let pipe = format!("path = \"{PROGRAM}\"");
    for path in [
        "../../etc/cron.d/x",
        "/etc/cron.d/x",
        "bin/../../x",
        ".",
        "",
        "bin/",
        "bin//pilot",
        "./bin",
        "manifest.toml",
        "manifest.sig",
        CONFIGURATION,
        "robot.toml/x",
        "a\\u0000b",
        "a\\nb",
        "\\u001b[2J",
        "\\u202Egnp",
        "C:\\\\x",
        &long,
    ] {
        let hostile = text.replacen(&pipe, &format!("path = \"{path}\""), 1);
        let signature = workshop.key.sign(hostile.as_bytes());
        let said = node.receive(&mut Hostile(hostile, signature)).unwrap_err().to_string();
        assert!(said.starts_with(node.path().to_str().unwrap()) && said.contains("manifest.toml: "), "{path}: {said}");
    }
    for (from, to) in [("size = 99", "size = 18446744073709551615"), ("size = 99", "size = 9223372036854775807")] {
        let hostile = text.replacen(from, to, 1);
        assert!(node.receive(&mut Hostile(hostile.clone(), workshop.key.sign(hostile.as_bytes()))).is_err());
    }
    assert!(!workshop.path("x").exists() && names(&node, "staging").is_empty() && names(&node, "bundles").is_empty());
}

#[test]
fn links_pipes_and_further_files_are_named_and_no_part_of_a_bundle() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let bundle = workshop.make("one");
    let map = bundle.folder().join(MAP);
    fs::rename(&map, workshop.path("outside")).unwrap();
    symlink(workshop.path("outside"), &map).unwrap();
    assert!(matches!(push(&node, &bundle), Err(ReceiveError::Source { .. })), "a link is not followed");
    fs::remove_file(&map).unwrap();
    fs::rename(workshop.path("outside"), &map).unwrap();
    push(&node, &bundle).unwrap();
    let at = |name: &str| node.path().join("current").join(name);
    let problems = || node.report().unwrap().problems;
    fs::remove_file(at(MAP)).unwrap();
    assert_eq!(problems(), ["maps/house.map is missing"]);
    symlink("/etc/passwd", at(MAP)).unwrap();
    assert_eq!(problems(), ["maps/house.map is no regular file"]);
    fs::remove_file(at(MAP)).unwrap();
    fs::create_dir(at(MAP)).unwrap();
    assert_eq!(problems(), ["maps/house.map is no regular file"]);
    fs::remove_dir_all(at("maps")).unwrap();
    symlink("/etc", at("maps")).unwrap();
    assert_eq!(problems(), ["maps is not in the manifest", "maps/house.map is missing"]);
    fs::remove_file(at("maps")).unwrap();
    fs::write(at("maps"), "a file").unwrap();
    fs::write(at(PROGRAM), "echo evil").unwrap();
    fs::set_permissions(at(CONFIGURATION), PermissionsExt::from_mode(0o755)).unwrap();
    assert_eq!(
        problems(),
        [
            "bin/pilot was changed: its content is not that of the manifest",
            "maps is not in the manifest",
            "maps/house.map is missing",
            "robot.toml has another permission to be executed than in the manifest",
        ]
    );
    let repaired = push(&node, &bundle).unwrap();
    assert_eq!((repaired.is_new, repaired.files_sent, current(&node)), (false, 2, 1), "what the node has is not sent");
}

#[test]
fn a_repair_takes_nothing_that_the_robot_has_written() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let text = "parameters = \"house.toml\"\ninstallation = \"test\"\nsystem = { name = \"test\", id = 1 }\n\
                classes = { router = { id = 250 }, output = { id = 32 }, tool = { id = 16 } }\nnodes.main = {}\n\
                [[module]]\nname = \"output.0\"\nbuiltin = \"output\"\n";
    let contents = [("config/robot.toml", text), ("config/house.toml", "")];
    let files = contents.map(|(path, content)| {
        let (source, path) = (workshop.path(path), FilePath::parse(path).unwrap());
        fs::create_dir_all(source.parent().unwrap()).unwrap();
        fs::write(&source, content).unwrap();
        Ingredient { path, source }
    });
    let recipe = Recipe {
        installation: "test".into(),
        version: None,
        trial: Duration::from_secs(1),
        configuration: files[0].path.clone(),
        files: files.to_vec(),
    };
    let bundle = make(&recipe, &workshop.key, &workshop.path("bundles")).unwrap();
    push(&node, &bundle).unwrap();
    let at = |name: &str| node.path().join("current/config").join(name);
    fs::write(at("house.toml"), "[probe.0]\n").unwrap();
    fs::write(at("written"), "").unwrap();
    let saved = "config/house.toml has other parameters than in the manifest, which were saved here";
    assert_eq!(node.report().unwrap().problems, [saved, "config/written is not in the manifest"]);
    assert_eq!(push(&node, &bundle).unwrap().files_sent, 0);
    assert!(at("written").exists() && fs::read_to_string(at("house.toml")).unwrap() == "[probe.0]\n");
    // A configuration that names itself is no way around.
    fs::write(at("robot.toml"), text.replace("house", "robot")).unwrap();
    let differences = node.bundle().unwrap().differences().unwrap();
    assert!(differences.iter().any(|difference| difference.path == "config/robot.toml" && !difference.is_harmless()));
}

#[test]
fn of_two_pushes_at_once_the_second_is_refused() {
    /// A push during which another one comes.
    struct Slow<'a>(FolderSource<'a>, &'a NodeFolder, &'a Bundle);
    impl Source for Slow<'_> {
        fn head(&mut self) -> io::Result<(Vec<u8>, Vec<u8>)> {
            self.0.head()
        }
        fn want(&mut self, files: &[usize]) -> io::Result<()> {
            assert!(matches!(push(self.1, self.2), Err(ReceiveError::Node(NodeFolderError::Pushing(_)))));
            self.0.want(files)
        }
        fn file(&mut self, file: &FileEntry) -> io::Result<Box<dyn Read + '_>> {
            assert!(matches!(push(self.1, self.2), Err(ReceiveError::Node(NodeFolderError::Pushing(_)))));
            self.0.file(file)
        }
    }
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let [first, second] = ["one", "two"].map(|says| workshop.make(says));
    assert!(node.receive(&mut Slow(FolderSource(&first), &node, &second)).unwrap().is_new);
    assert_eq!(current(&node), 1);
    push(&node, &second).unwrap();
}

#[test]
fn a_stream_carries_what_lacks_and_an_interrupted_one_goes_on() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let bundle = workshop.make("one");
    let over_a_stream = |cut: Option<u64>| {
        let (ours, theirs) = UnixStream::pair().unwrap();
        std::thread::scope(|scope| {
            let receiver = scope.spawn(|| {
                let (theirs, answers) = (theirs.try_clone().unwrap(), theirs);
                let from = BufReader::new(theirs.take(cut.unwrap_or(u64::MAX)));
                node.receive(&mut StreamSource::new(from, &answers)).map_err(|error| error.to_string())
            });
            let mut from = BufReader::new(ours.try_clone().unwrap());
            let sent = send(&bundle, &mut &ours, &mut from);
            drop((ours, from));
            (sent, receiver.join().unwrap())
        })
    };
    let manifest = bundle.manifest_bytes().len() as u64;
    let all = manifest + 300 + bundle.manifest().size();
    for cut in [0, 5, 30, manifest, manifest + 240, manifest + 300, all - 90] {
        let (_, received) = over_a_stream(Some(cut));
        assert!(received.unwrap_err().contains("did not come") || cut > manifest, "{cut}");
        assert_eq!(current(&node), 0, "{cut}");
    }
    let (sent, received) = over_a_stream(None);
    let received = received.unwrap();
    assert_eq!((sent.unwrap(), received.files_sent, current(&node)), (received.files_sent, received.files_sent, 1));
    assert!(received.files_sent < 3, "whole files of an interrupted push are kept");
    let (sent, received) = over_a_stream(None);
    assert_eq!((sent.unwrap(), received.unwrap().is_new), (0, false));
}

#[test]
fn what_a_running_launch_needs_stays_and_versions_rise() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    let first = workshop.make("one");
    push(&node, &first).unwrap();
    let launch = Trial::begin(&node, first.digest()).unwrap();
    // Also after a repair, which exchanges its folder.
    fs::remove_file(node.path().join("current").join(MAP)).unwrap();
    assert_eq!(push(&node, &first).unwrap().files_sent, 1);
    let rest: Vec<Bundle> = (0..4).map(|number| workshop.make(&number.to_string())).collect();
    rest.iter().for_each(|bundle| assert!(push(&node, bundle).unwrap().is_new));
    let is_there = |bundle: &Bundle| node.path().join("bundles").join(bundle.digest().to_string()).exists();
    assert!(is_there(&first) && !is_there(&rest[0]) && rest[1..].iter().all(is_there));
    drop(launch);
    push(&node, &workshop.make("last")).unwrap();
    assert!(!is_there(&first));
    let version = |version| {
        let path = FilePath::parse(CONFIGURATION).unwrap();
        let recipe = Recipe {
            installation: "test".into(),
            version,
            trial: Duration::from_secs(1),
            configuration: path.clone(),
            files: vec![Ingredient { source: workshop.path(CONFIGURATION), path }],
        };
        make(&recipe, &workshop.key, &workshop.path("bundles"))
    };
    assert!(matches!(version(Some(6)), Err(MakeError::NotHigher { version: 6, newest: 6, .. })));
    assert_eq!(version(Some(10)).unwrap().manifest().version(), 10);
    assert_eq!(version(None).unwrap().manifest().version(), 11);
    assert_eq!(names(&NodeFolder::new(workshop.path("")), "bundles").len(), 8, "nothing else is left there");
}

#[test]
fn a_node_that_lost_its_files_says_what_is_missing() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    assert!(matches!(node.report(), Err(NodeFolderError::Empty(_))));
    let bundle = workshop.make("one");
    push(&node, &bundle).unwrap();
    fs::write(node.path().join("state.toml"), "newest-version = 1").unwrap();
    let said = push(&node, &bundle).unwrap_err().to_string();
    assert!(said.contains("state.toml: no state of bundles: missing field"), "{said}");
    fs::remove_file(node.path().join("state.toml")).unwrap();
    assert_eq!(current(&node), 1);
    fs::remove_file(node.path().join("current")).unwrap();
    fs::write(node.path().join("current"), "").unwrap();
    assert!(matches!(node.report(), Err(NodeFolderError::Current(_))));
    fs::remove_file(node.path().join("current")).unwrap();
    symlink("/etc", node.path().join("current")).unwrap();
    assert!(matches!(push(&node, &bundle), Err(ReceiveError::Node(NodeFolderError::Current(_)))));
    fs::remove_file(node.path().join("current")).unwrap();
    push(&node, &bundle).unwrap();
    let manifest = node.path().join("current/manifest.toml");
    let other = Manifest::parse(&fs::read(&manifest).unwrap()).unwrap().text().replace("version = 1", "version = 9");
    File::create(&manifest).and_then(|mut file| io::Write::write_all(&mut file, other.as_bytes())).unwrap();
    let problems = node.report().unwrap().problems;
    assert!(problems[0].contains("its digest is not the name") && problems[1].contains("signature"), "{problems:?}");
    let config = node.path().join("current").join(CONFIGURATION);
    assert!(NodeFolder::containing(&config).unwrap_err().to_string().contains("it was changed"));
    assert!(NodeFolder::containing(Path::new("/etc/hostname")).unwrap().is_none());
    assert_ne!(Sha256::of(other.as_bytes()), bundle.digest());
    push(&node, &bundle).unwrap();
    assert_eq!(current(&node), 1, "repaired");
    let signature = workshop.key.sign(b"something else").text();
    fs::write(node.path().join("current/manifest.sig"), signature).unwrap();
    assert_eq!(node.report().unwrap().problems.len(), 1);
    push(&node, &bundle).unwrap();
    assert_eq!(current(&node), 1, "repaired");
    assert!(SigningKey::load(&workshop.path("keys/bundle.pub")).is_err());
}
