//! Bundles by their commands: made on one computer, pushed to others by folder and by ssh, checked, taken back.

use crate::harness::{Place, assert_has, head, program};
use crate::process::{Running, Said};
use crate::small_memory::{may_mount, with_small_memory};
use rohrpost_bundle::NodeFolder;
use rohrpost_testbed::report::skipped;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The configuration in the bundle's source, and the program of its module.
const CONFIGURATION: &str = "source/config/robot.toml";
const PROGRAM: &str = "source/bin/probe.sh";

/// A place where bundles are made.
pub(crate) struct Workshop {
    pub(crate) place: Place,
}

impl Workshop {
    /// One with a configuration, of which the one module is a script that starts a probe.
    pub(crate) fn new() -> Self {
        let place = Place::new();
        ["source/config", "source/bin", "source/maps"]
            .iter()
            .for_each(|folder| fs::create_dir_all(place.path(folder)).unwrap());
        place.write("source/maps/house.map", "#".repeat(100));
        let config = format!(
            "{}[nodes.main]\n[[module]]\nname = \"probe.0\"\nprogram = \"../bin/probe.sh\"\nsettings = {{ record = \
             {:?} }}\nrestart = {{ at-most = 2, backoff = \"10 ms\" }}\n",
            head("router 250, probe 96, output 32, tool 16"),
            place.path("record")
        );
        let workshop = Self { place };
        workshop.place.write(CONFIGURATION, config);
        workshop.write_program("");
        workshop.place.say(&["keys", "bundle", "source/config/keys"]).ok();
        workshop
    }

    /// Writes the program, with further lines of a shell before it starts the probe.
    pub(crate) fn write_program(&self, lines: &str) {
        let words = program("probe::module").replace(['[', ']', ','], " ");
        self.place.program(PROGRAM, format!("#!/bin/sh\n{lines}\nexec {words}\n"));
    }

    /// Makes the next version; its folder.
    pub(crate) fn make(&self, trial: &str) -> PathBuf {
        let said = self.say(&["make", CONFIGURATION, "--with", "source/maps", "--trial", trial]).ok();
        PathBuf::from(said.lines().find_map(|line| line.strip_prefix("made ")).unwrap())
    }

    /// A node that trusts the key; its folder.
    pub(crate) fn node(&self, name: &str) -> String {
        let trusted = self.place.path(name).join("trusted");
        fs::create_dir_all(&trusted).unwrap();
        fs::copy(self.place.path("source/config/keys/bundle.pub"), trusted.join("ours.pub")).unwrap();
        self.place.path(name).to_str().unwrap().to_owned()
    }

    pub(crate) fn say(&self, arguments: &[&str]) -> Said {
        self.place.say(&[&["bundle"], arguments].concat())
    }

    pub(crate) fn push(&self, node: &str) -> Said {
        self.say(&["push", "source/config/bundles", "--to", node])
    }

    /// A program in place of `ssh`, and PATH with it and with the command; says what it is for.
    pub(crate) fn command_with_ssh(&self, ssh: &str, arguments: &[&str]) -> Command {
        fs::create_dir_all(self.place.path("path")).unwrap();
        self.place.program("path/ssh", ssh);
        let mut command = self.place.command(arguments);
        let rohrpost = Path::new(command.get_program()).parent().unwrap().display();
        let path = format!("{}:{rohrpost}:/usr/bin:/bin", self.place.path("path").display());
        command.env("PATH", path);
        command
    }
}

/// Version of what a node has, all of which is right.
#[track_caller]
pub(crate) fn current(node: &str) -> u64 {
    let report = NodeFolder::new(node).report().unwrap();
    assert_eq!(report.problems, [""; 0]);
    report.version
}

#[test]
fn a_bundle_is_made_pushed_checked_and_taken_back() {
    let workshop = Workshop::new();
    let [base, arm] = ["base", "arm"].map(|name| workshop.node(name));
    let first = workshop.make("2 min");
    let said = workshop.say(&["show", first.to_str().unwrap()]).ok();
    assert_has(
        &said,
        [
            "version 1 of test, bundle ",
            "trial 120 s",
            "launched from config/robot.toml",
            "\nbin/probe.sh ",
            " program\n",
        ],
    );
    assert_has(&said, ["\nconfig/robot.toml ", "\nmaps/house.map     100 B  "]);
    workshop
        .say(&["check", &base, &arm])
        .fails_with_out(["FILES DIFFER, or a node has no bundle", "base: no bundle there; `rohrpost bundle push"]);
    let said = workshop.say(&["push", "source/config/bundles", "--to", &base, "--to", &arm]).ok();
    assert_has(&said, ["arm: version 1, bundle ", "is current now; 3 of 3 files sent\n", "current/config/robot.toml"]);
    workshop.say(&["check", &base, &arm]).ok_with(["all nodes have the same bundle, and all files are as"]);
    let map = Path::new(&arm).join("current/maps/house.map");
    fs::write(&map, "#".repeat(99) + " ").unwrap();
    let said = workshop.say(&["check", &base, &arm]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert_has(
        &said.out,
        ["FILES DIFFER", "arm: maps/house.map was changed: its content is not that of the manifest\n"],
    );
    assert!(!said.out.contains("base: "), "{said:?}");
    workshop.push(&arm).ok_with(["was current already; 1 of 3 files sent"]);
    workshop.say(&["check", &base, &arm]).ok();
    workshop.write_program("# another");
    workshop.make("30 s");
    workshop.push(&arm).ok_with(["version 2, bundle ", "is current now; 1 of 3 files sent"]);
    let said = workshop.say(&["check", &base, &arm, "--json"]);
    let answers: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &answers[1]["report"]["before"]), (Some(1), &serde_json::json!([1])));
    assert_has(&workshop.say(&["check", &base, &arm]).out, ["NODES DIFFER"]);
    workshop.say(&["push", first.to_str().unwrap(), "--to", &arm]).fails_with(["version 1 is older than version 2"]);
    workshop.say(&["back", &arm]).ok_with(["back from version 2 to version 1"]);
    workshop.say(&["check", &base, &arm]).ok();
    workshop.say(&["back", &arm]).fails_with(["no bundle before version 1"]);
}

#[test]
fn what_would_not_run_on_a_node_is_no_bundle() {
    let workshop = Workshop::new();
    let text = fs::read_to_string(workshop.place.path(CONFIGURATION)).unwrap();
    let config = |more: &str| workshop.place.write(CONFIGURATION, format!("{text}{more}"));
    config("[output]\nfile = \"log/output.log\"\n[[module]]\nname = \"output.0\"\nbuiltin = \"output\"\n");
    workshop.say(&["make", CONFIGURATION]).fails_with(["file of [output]: `log/output.log` would lie in the bundle"]);
    config("[[module]]\nname = \"probe.1\"\nprogram = \"../bin/none\"\n");
    workshop.say(&["make", CONFIGURATION]).fails_with(["bin/none: cannot be read"]);
    config("[[module]]\nname = \"probe.1\"\nprogram = \"/bin/true\"\noptional = true\n");
    workshop
        .say(&["make", CONFIGURATION])
        .ok_with(["note: probe.1 runs `/bin/true`, which each node must have itself"]);
    config("");
    workshop.say(&["make", CONFIGURATION, "--with", "source/config/keys"]).fails_with(["bundle.key: this is a key"]);
    workshop.place.write("source/maps/id", "-----BEGIN OPENSSH PRIVATE KEY-----\nb3\n");
    workshop.say(&["make", CONFIGURATION, "--with", "source/maps"]).fails_with(["maps/id: this is a key"]);
    fs::remove_file(workshop.place.path("source/maps/id")).unwrap();
    std::os::unix::fs::symlink("/etc", workshop.place.path("source/maps/etc")).unwrap();
    workshop.say(&["make", CONFIGURATION, "--with", "source/maps"]).fails_with(["maps/etc: a link to a folder"]);
    workshop.say(&["make", CONFIGURATION, "--version", "1"]).fails_with(["version 1 is not higher than version 1"]);
    workshop
        .say(&["make", CONFIGURATION, "--key", "none"])
        .fails_with(["none: cannot be read", "rohrpost keys bundle"]);
    workshop.say(&["push", "source", "--to", "node"]).fails_with(["source: no bundle there"]);
    workshop.place.say(&["keys", "bundle", "source/config/keys"]).fails_with(["there is a key already"]);
}

#[test]
fn a_bundle_has_the_hosts_of_a_team_and_never_its_keys() {
    let workshop = Workshop::new();
    let text = fs::read_to_string(workshop.place.path(CONFIGURATION)).unwrap();
    let text = text.replace("[classes]\n", "[classes]\nteam-router = { id = 65 }\n");
    let config = |keys: &str| {
        let team = "[team]\nsecurity = \"keys\"\naddress = \"10.0.0.1\"\npeers = \"../hosts\"\n";
        workshop.place.write(CONFIGURATION, format!("{text}{team}{keys}"));
    };
    workshop.place.write("source/hosts", "2 10.0.0.2\n");
    config("");
    workshop.say(&["make", CONFIGURATION]).fails_with(["keys of [team]: `team-keys` would lie in the bundle"]);
    config("keys = \"/etc/rohrpost/team-keys\"\n");
    let bundle = workshop.make("1 min");
    let hosts = workshop.place.path(bundle.join("hosts").to_str().unwrap());
    assert_eq!(fs::read_to_string(hosts).unwrap(), "2 10.0.0.2\n");
}

/// Runs what it is told here, with the folder of a host of its own. Prints a line first, as shells of nodes do.
const FAKE_SSH: &str = "#!/bin/sh\n[ \"$1\" = -- ] || exit 9\nhost=$2; shift 2\necho welcome to $host\n\
                        [ $host = off ] && { echo no route >&2; exit 255; }\n[ $host = bare ] && PATH=/bin\n\
                        cd $host && exec sh -c \"$*\"\n";

#[test]
fn a_bundle_goes_by_ssh_to_a_folder_with_any_name() {
    let workshop = Workshop::new();
    workshop.node("base/it's here");
    workshop.node("bare/it's here");
    workshop.make("30 s");
    let place = "base:it's here";
    let say = |arguments: &[&str]| Running::start(workshop.command_with_ssh(FAKE_SSH, arguments)).said();
    by_ssh(&workshop, &say);
    say(&["bundle", "check", "bare:it's here"]).fails_with_out(["bare:it's here: `rohrpost` is not on the PATH"]);
    say(&["bundle", "push", "source/config/bundles", "--to", "off:x"])
        .fails_with(["no route", "off:x: ssh has failed"]);
    fs::remove_dir_all(workshop.place.path("base/it's here/trusted")).unwrap();
    let said = say(&["bundle", "push", "source/config/bundles", "--to", place]);
    said.fails_with(["no key is trusted", "base:it's here: refused"]);
}

/// Pushes to the folder `it's here` of the host `base`, which is the folder `base`, by the commands of a person there.
pub(crate) fn by_ssh(workshop: &Workshop, say: &dyn Fn(&[&str]) -> Said) {
    let place = "base:it's here";
    let push = || say(&["bundle", "push", "source/config/bundles", "--to", place]);
    push().ok_with(["it's here: version 1, bundle ", "is current now; 3 of 3 files sent"]);
    push().ok_with(["was current already; 0 of 3 files sent"]);
    let node = workshop.place.path("base/it's here");
    assert_eq!(current(node.to_str().unwrap()), 1);
    fs::write(node.join("current/maps/house.map"), "").unwrap();
    say(&["bundle", "check", place]).fails_with_out(["base:it's here: maps/house.map was changed"]);
    push().ok_with(["1 of 3 files sent"]);
    workshop.write_program("# another");
    workshop.make("30 s");
    push().ok_with(["version 2, bundle ", "is current now; 1 of 3 files sent"]);
    say(&["bundle", "back", place]).ok_with(["back from version 2 to version 1"]);
    say(&["bundle", "check", place]).ok_with(["all files are as the manifest says"]);
}

impl Said {
    /// The command failed, and what it found is on the standard output.
    #[track_caller]
    fn fails_with_out<const N: usize>(self, words: [&str; N]) {
        assert_eq!(self.code, Some(1), "{self:?}");
        assert_has(&self.out, words);
    }
}

#[test]
fn a_full_disk_keeps_the_bundle_before() {
    if !may_mount() {
        return skipped("a full disk (file systems cannot be mounted here)");
    }
    let workshop = Workshop::new();
    let first = workshop.make("30 s");
    workshop.place.write("source/maps/large.map", vec![7; 1 << 20]);
    workshop.make("30 s");
    // Room for the first bundle, not for the second; what the shell tells of the disk, nobody else sees.
    let disk = workshop.place.path("disk");
    fs::create_dir_all(&disk).unwrap();
    let script = "cp -r \"$2\" disk/trusted && \"$1\" bundle push \"$3\" --to disk && \
                  ! \"$1\" bundle push source/config/bundles --to disk && \"$1\" bundle check disk && \
                  ls disk/staging | wc -l";
    let rohrpost = workshop.place.command(&[]).get_program().to_owned();
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh"]).arg(rohrpost).arg(workshop.node("node") + "/trusted").arg(first);
    command.current_dir(workshop.place.path(""));
    with_small_memory(&mut command, &disk, 128);
    let told = command.output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&told.stdout), String::from_utf8_lossy(&told.stderr));
    assert!(told.status.success(), "{out}\n{err}");
    assert_has(&err, ["disk/staging/", "maps/large.map: cannot be written (No space left on device"]);
    assert_has(&out, ["all files are as the manifest says", "\n0\n"]);
}
