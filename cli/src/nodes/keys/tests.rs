//! Keys and certificates of a robot are made, changed and shown in a folder.

use super::*;

const DAYS: u32 = 30;

fn step(step: fn(Place) -> Step, path: &Path) -> Result<ExitCode, String> {
    let arguments = Arguments { step: step(Place { path: path.into(), days: DAYS }) };
    run(&arguments).map_err(|failure| failure.to_string())
}

fn rotate(place: Place) -> Step {
    Step::Rotate { place, authority: false }
}

fn begin_anew(place: Place) -> Step {
    Step::Rotate { place, authority: true }
}

#[test]
fn keys_are_made_changed_and_shown_only_as_fingerprints() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("keys");
    let file = Keys::file(&folder);
    assert!(step(Step::Show, &folder).unwrap_err().contains("rohrpost keys new"));
    step(Step::New, &folder).unwrap();
    let first = Keys::load(&file).unwrap();
    assert!(step(Step::New, &folder).unwrap_err().contains("already"), "no key is ever overwritten by a first one");
    step(rotate, &folder).unwrap();
    let both = Keys::load(&file).unwrap();
    assert_eq!(both.older, Some(first.newest));
    assert_ne!(both.older.as_ref().map(|older| older.bytes), Some(both.newest.bytes));
    let said = text(Path::new("udp.keys"), &both);
    let secret = std::fs::read_to_string(&file).unwrap();
    let digits = secret.lines().filter_map(|line| line.split_whitespace().nth(2)).filter(|word| word.len() == 64);
    assert_eq!(digits.filter(|digits| said.contains(&digits[..8])).count(), 0, "{said}");
    assert_ne!(fingerprint(&both.newest), fingerprint(both.older.as_ref().unwrap()));
    step(Step::Finish, &folder).unwrap();
    assert_eq!(Keys::load(&file).unwrap(), Keys { older: None, ..both });
}

#[test]
fn keys_of_a_team_are_made_from_its_file_and_changed_only_by_their_folder() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("team.toml");
    std::fs::write(&file, include_str!("../../../../config/tests/team.toml")).unwrap();
    step(Step::New, &file).unwrap();
    let folder = place.path().join("keys-of-all");
    let made = Keys::load(&Keys::file(&folder)).unwrap();
    step(Step::New, &file).unwrap();
    step(Step::Show, &file).unwrap();
    for (refused, word) in [(step(rotate, &file), "rotate"), (step(Step::Finish, &file), "finish")] {
        let right = format!("rohrpost keys {word} {}", folder.display());
        assert!(refused.unwrap_err().contains(&right), "{word}");
    }
    assert_eq!(Keys::load(&Keys::file(&folder)).unwrap(), made, "and nothing was changed");
}

/// A robot of two computers and a laptop; the installation has this name.
fn robot(place: &Path, installation: &str) -> PathBuf {
    let text = include_str!("../../../../config/demo-tcp.toml")
        .replace("installation = \"demo-tcp\"", &format!("installation = \"{installation}\""))
        .replace("[network]\nsecurity = \"none\"", "[network]\nsecurity = \"keys\"")
        .replace("[tcp]\nsecurity = \"none\"", "[tcp]\nsecurity = \"tls\"\ncertificates = \"shown\"");
    let file = place.join("robot.toml");
    std::fs::write(place.join("building.map"), include_str!("../../../../config/building.map")).unwrap();
    std::fs::write(&file, text).unwrap();
    file
}

/// All files in the folder of certificates.
fn shown(place: &Path) -> std::collections::BTreeMap<String, String> {
    let read = |entry: std::io::Result<std::fs::DirEntry>| {
        let path = entry.unwrap().path();
        (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read_to_string(&path).unwrap())
    };
    std::fs::read_dir(place.join("shown")).unwrap().map(read).collect()
}

/// Whether the existing authority signed the certificates of base and TCP router.
fn fit(file: &Path) -> bool {
    use rohrpost_routers::tcp::{Authority, Holder};
    let installation = load(file).unwrap();
    let folder = certificates::folder(&installation).unwrap();
    let authority = Authority::load(&folder.join("ca.pem")).unwrap();
    let holders = [Holder::Router, Holder::Node { node: "desk".into(), system: 1 }];
    holders.iter().all(|holder| authority.has_signed(&folder.join(format!("{}.pem", holder.file_name()))))
}

#[test]
fn one_command_makes_all_files_and_one_renews_them() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    step(Step::New, &file).unwrap();
    let (first, key) = (shown(place.path()), Keys::load(&Keys::file(&place.path().join("keys"))).unwrap());
    let names = ["base.system-1", "brain.system-1", "ca", "desk.system-1", "tcp-router"];
    assert!(
        first.keys().eq(names
            .iter()
            .flat_map(|name| [format!("{name}.key"), format!("{name}.pem")])
            .collect::<Vec<_>>()
            .iter())
    );
    assert!(fit(&file));
    step(Step::New, &file).unwrap();
    assert_eq!(shown(place.path()), first, "existing files stay");
    std::fs::remove_file(place.path().join("shown/brain.system-1.pem")).unwrap();
    step(Step::New, &file).unwrap();
    let fixed = shown(place.path());
    assert!(fixed.len() == first.len() && fixed["brain.system-1.pem"] != first["brain.system-1.pem"]);
    assert_eq!((&fixed["ca.pem"], &fixed["desk.system-1.pem"]), (&first["ca.pem"], &first["desk.system-1.pem"]));
    step(rotate, &file).unwrap();
    let rotated = shown(place.path());
    assert!(rotated["ca.pem"] == first["ca.pem"] && rotated["desk.system-1.pem"] != first["desk.system-1.pem"]);
    assert_eq!(Keys::load(&Keys::file(&place.path().join("keys"))).unwrap().older, Some(key.newest));
    let refused = step(rotate, &file).unwrap_err();
    assert!(refused.contains("keys finish") && shown(place.path()) == rotated, "all or nothing: {refused}");
    step(Step::Finish, &file).unwrap();
    step(Step::Show, &file).unwrap();
}

#[test]
fn a_damaged_or_renamed_authority_is_fixed_or_reported() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    step(Step::New, &file).unwrap();
    let first = shown(place.path());
    // A renamed installation still signs under the authority's name.
    robot(place.path(), "another");
    std::fs::remove_file(place.path().join("shown/desk.system-1.pem")).unwrap();
    step(Step::New, &file).unwrap();
    assert!(fit(&file), "by the authority that is there");
    // Its certificate can be made anew from its key.
    robot(place.path(), "one");
    std::fs::remove_file(place.path().join("shown/ca.pem")).unwrap();
    step(Step::New, &file).unwrap();
    assert!(shown(place.path())["ca.key"] == first["ca.key"] && fit(&file), "old certificates hold");
    // Under another name, old signatures are no longer valid.
    robot(place.path(), "another");
    std::fs::remove_file(place.path().join("shown/ca.pem")).unwrap();
    step(Step::New, &file).unwrap();
    assert!(shown(place.path())["ca.key"] == first["ca.key"] && fit(&file), "all are signed again");
    // Its key cannot be made anew.
    std::fs::remove_file(place.path().join("shown/ca.key")).unwrap();
    let sealing = Keys::file(&place.path().join("keys"));
    let key = Keys::load(&sealing).unwrap();
    let lost = step(rotate, &file).unwrap_err();
    assert!(lost.contains("keys rotate --authority"), "{lost}");
    assert_eq!(Keys::load(&sealing).unwrap(), key, "all or nothing");
    step(begin_anew, &file).unwrap();
    assert!(fit(&file) && shown(place.path()).contains_key("ca.pem.old"));
    step(Step::Finish, &file).unwrap();
    // Key and certificate belong to different authorities.
    let now = shown(place.path());
    std::fs::write(place.path().join("shown/ca.key"), &first["ca.key"]).unwrap();
    for halves in [step(rotate, &file), step(Step::New, &file)] {
        let other = halves.unwrap_err();
        assert!(other.contains("of two authorities"), "{other}");
    }
    assert!(super::show(&KeyFiles::by(&file).unwrap()).unwrap().join("\n").contains("ca.key: is not the key of"));
    assert_eq!(shown(place.path())["desk.system-1.pem"], now["desk.system-1.pem"]);
}

#[test]
fn a_new_authority_never_replaces_certificates_of_another() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    step(Step::New, &file).unwrap();
    for name in ["ca.key", "ca.pem"] {
        std::fs::remove_file(place.path().join("shown").join(name)).unwrap();
        let before = shown(place.path());
        let said = step(Step::New, &file);
        match name {
            // The authority's key is kept off the robots.
            "ca.key" => assert!(said.is_ok(), "{said:?}"),
            _ => assert!(said.as_ref().is_err_and(|said| said.contains("keys rotate --authority")), "{said:?}"),
        }
        assert_eq!(shown(place.path()), before);
    }
}

#[test]
fn invalid_certificates_are_listed_and_replaced_and_valid_ones_stay() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    let says = || super::show(&KeyFiles::by(&file).unwrap()).unwrap().join("\n");
    step(Step::New, &file).unwrap();
    let first = shown(place.path());
    assert!(!says().contains("keys new"), "{}", says());
    let put = |name: &str, text: &str| std::fs::write(place.path().join("shown").join(name), text).unwrap();
    // The state after a crash between the two writes.
    put("base.system-1.key", &first["desk.system-1.key"]);
    assert!(says().contains("base.system-1.pem: certificate and key do not match; `rohrpost keys new`"), "{}", says());
    step(Step::New, &file).unwrap();
    let fixed = shown(place.path());
    assert!(!says().contains("keys new") && fixed["base.system-1.pem"] != first["base.system-1.pem"]);
    for (name, text) in fixed.iter().filter(|(name, _)| !name.starts_with("base.")) {
        assert_eq!(text, &first[name], "{name} stays");
    }
    // Expired.
    certificates::make(&load(&file).unwrap(), Renewal::All, 0).unwrap();
    while fit(&file) {
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    assert!(says().contains("has expired"), "{}", says());
    step(Step::New, &file).unwrap();
    assert!(fit(&file) && !says().contains("keys new"), "{}", says());
}

#[test]
fn a_failed_write_changes_nothing() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    step(Step::New, &file).unwrap();
    let sealing = Keys::file(&place.path().join("keys"));
    let (first, key) = (shown(place.path()), Keys::load(&sealing).unwrap());
    let in_the_way = place.path().join("shown/tcp-router.pem.new");
    std::fs::create_dir(&in_the_way).unwrap();
    for step_of in [rotate, begin_anew] {
        let said = step(step_of, &file).unwrap_err();
        assert!(said.contains("tcp-router.pem"), "{said}");
        assert_eq!(Keys::load(&sealing).unwrap(), key);
    }
    std::fs::remove_dir(&in_the_way).unwrap();
    assert_eq!(shown(place.path()), first);
    std::fs::write(&in_the_way, "a user's").unwrap();
    assert!(step(rotate, &file).unwrap_err().contains("tcp-router.pem.new: this was left"));
    assert_eq!(std::fs::read_to_string(&in_the_way).unwrap(), "a user's");
    std::fs::remove_file(&in_the_way).unwrap();
    assert_eq!(shown(place.path()), first);
    // Each earlier authority is kept, even after another new start.
    step(begin_anew, &file).unwrap();
    let second = shown(place.path());
    step(Step::Finish, &file).unwrap();
    step(begin_anew, &file).unwrap();
    let third = shown(place.path());
    assert_eq!((&third["ca.key.old"], &third["ca.key.old-2"]), (&first["ca.key"], &second["ca.key"]));
    assert!(third["ca.key"] != second["ca.key"] && fit(&file));
}

#[test]
fn a_missing_file_is_no_folder_of_keys() {
    let place = tempfile::tempdir().unwrap();
    let mistyped = place.path().join("robto.toml");
    let said = step(Step::New, &mistyped).unwrap_err();
    assert!(said.contains("robto.toml: no such file") && !mistyped.exists(), "{said}");
}

#[test]
fn a_configuration_without_security_needs_no_keys() {
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo.toml");
    let said = step(Step::New, &demo).unwrap_err();
    assert!(said.contains("nothing here is sealed"), "{said}");
}

#[test]
fn validity_of_certificates_and_age_of_keys_are_shown() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    let says = |of: &str| {
        let lines = super::show(&KeyFiles::by(&file).unwrap()).unwrap();
        lines.into_iter().find(|line| line.contains(of)).unwrap()
    };
    step(Step::New, &file).unwrap();
    let make = |days| certificates::make(&load(&file).unwrap(), Renewal::All, days).unwrap();
    // Less than a second may have passed, or more.
    let lasts = |days: u32| {
        let said = says("desk.system-1.pem");
        let is_so =
            [days - 1, days].iter().any(|days| said.contains(&format!("is there, valid for {days} days, until ")));
        assert!(is_so, "{said}");
        said.contains("`rohrpost keys rotate` makes new ones")
    };
    make(20);
    assert!(lasts(20), "it expires soon");
    assert!(
        says("desk.system-1.key").ends_with("desk.system-1.key: is there"),
        "a key holds as long as its certificate"
    );
    make(400);
    assert!(!lasts(400));
    assert!(says("udp.keys: written").ends_with("written less than a day ago"));
    let before = std::time::SystemTime::now() - 3 * certificates::DAY;
    std::fs::File::open(place.path().join("keys/udp.keys")).unwrap().set_modified(before).unwrap();
    assert!(says("udp.keys: written").ends_with("written 3 days ago"));
}

/// Python 3.13 checks this strictly by default.
#[test]
fn strict_verifiers_accept_the_certificates() {
    let place = tempfile::tempdir().unwrap();
    let file = robot(place.path(), "one");
    // Certificates of a first authority, and of one that was read from its files.
    for made in [Step::New, rotate as fn(Place) -> Step] {
        step(made, &file).unwrap();
        let mut python = std::process::Command::new("python3");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/nodes/keys/strict.py");
        python.arg(script).arg(place.path().join("shown")).args(["tcp-router", "desk.system-1"]);
        let said = python.output().unwrap();
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    }
}
