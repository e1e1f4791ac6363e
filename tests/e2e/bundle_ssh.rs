//! Bundles over OpenSSH, between two computers in namespaces: pushed, changed, checked, and back by themselves.

use crate::bundle::{Workshop, by_ssh, current};
use crate::harness::{ROHRPOST, lab, until};
use crate::process::{Running, Said};
use rohrpost_testbed::report::skipped;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The computers: a person's, and the robot's.
const COMPUTERS: [(&str, &str); 2] = [("desk", "10.83.0.1"), ("base", "10.83.0.2")];
/// Where the server listens, at the robot.
const PORT: u16 = 2222;
/// The node on the robot, as the person names it.
const NODE: &str = "base:it's here";

/// The server as it is installed, or as `.ci/run` unpacks it below `target`; and that folder.
fn server() -> Option<(PathBuf, PathBuf)> {
    let unpacked = Path::new(ROHRPOST).ancestors().nth(2)?.join("openssh");
    let roots = [PathBuf::from("/"), unpacked];
    roots.into_iter().map(|root| (root.join("usr/sbin/sshd"), root)).find(|(sshd, _)| sshd.is_file())
}

/// Starts the server where the caller's sockets are. It lets in each client that has the test's key.
///
/// Root needs the user `sshd` and the folder `/run/sshd`: both are the server's alone, in mounts of its own.
fn serve(workshop: &Workshop, (sshd, root): &(PathBuf, PathBuf)) -> Running {
    let at = |name: &str| workshop.place.path(name).display().to_string();
    let mut config = format!(
        "ListenAddress {}:{PORT}\nHostKey {}\nAuthorizedKeysFile {}\nStrictModes no\nUsePAM no\nPidFile none\n\
         PermitRootLogin yes\nForceCommand cd {} && ROHRPOST_DIR={} PATH={}:$PATH && eval \"$SSH_ORIGINAL_COMMAND\"\n",
        COMPUTERS[1].1,
        at("ssh/host"),
        at("ssh/own.pub"),
        at("base"),
        workshop.place.memory().display(),
        Path::new(ROHRPOST).parent().unwrap().display(),
    );
    for (key, program) in [("SshdSessionPath", "sshd-session"), ("SshdAuthPath", "sshd-auth")] {
        let program = root.join("usr/lib/openssh").join(program);
        if program.is_file() {
            config += &format!("{key} {}\n", program.display());
        }
    }
    workshop.place.write("ssh/sshd_config", config);
    let users = fs::read_to_string("/etc/passwd").unwrap();
    workshop.place.write("ssh/passwd", users + "sshd:x:65534:65534::/run/sshd:/usr/sbin/nologin\n");
    let run = "exec \"$1\" -D -e -f ssh/sshd_config";
    let as_root = format!(
        "exec unshare --mount sh -c 'mount --bind ssh/passwd /etc/passwd && mount -t tmpfs tmpfs /run && mkdir \
         /run/sshd && {run}' sh \"$1\""
    );
    let mut command = Command::new("sh");
    command.args(["-c", if nix::unistd::geteuid().is_root() { &as_root } else { run }, "sh"]).arg(sshd);
    let libraries = fs::read_dir(root.join("usr/lib")).unwrap().flatten().map(|entry| entry.path());
    let own = libraries.filter(|path| path.display().to_string().ends_with("-linux-gnu"));
    command.env("LD_LIBRARY_PATH", std::env::join_paths(own).unwrap()).current_dir(workshop.place.path(""));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut server = Running::start(command);
    until("the server listens", || server.err().contains("Server listening") || server.ended().is_some());
    assert!(server.ended().is_none(), "{:?}", server.said());
    server
}

/// Keys of the server and of the person, and the program in place of `ssh`, which knows them and no others.
fn client(workshop: &Workshop) -> String {
    let at = |name: &str| workshop.place.path(name).display().to_string();
    fs::create_dir(at("ssh")).unwrap();
    fs::set_permissions(at("ssh"), PermissionsExt::from_mode(0o700)).unwrap();
    for key in ["ssh/host", "ssh/own"] {
        let made = Command::new("ssh-keygen").args(["-q", "-t", "ed25519", "-N", "", "-f", &at(key)]).status();
        assert!(made.unwrap().success(), "{key}");
    }
    let key = fs::read_to_string(at("ssh/host.pub")).unwrap();
    workshop.place.write("ssh/known_hosts", format!("[{}]:{PORT} {key}", COMPUTERS[1].1));
    let config = format!(
        "Host base\nHostName {}\nPort {PORT}\nIdentityFile {}\nUserKnownHostsFile {}\nLogLevel ERROR\nBatchMode yes\n",
        COMPUTERS[1].1,
        at("ssh/own"),
        at("ssh/known_hosts")
    );
    workshop.place.write("ssh/config", config);
    format!("#!/bin/sh\nexec /usr/bin/ssh -F {} \"$@\"\n", at("ssh/config"))
}

#[test]
fn a_bundle_goes_by_openssh_to_another_computer_and_a_bad_one_is_back_by_itself() {
    let Some(found) = server().filter(|_| Path::new("/usr/bin/ssh").is_file()) else {
        return skipped("pushes by OpenSSH (no `ssh`, or no `sshd`, which .ci/run unpacks)");
    };
    let Some(lab) = lab(COMPUTERS, "pushes by OpenSSH") else { return };
    let workshop = Workshop::new();
    workshop.node("base/it's here");
    workshop.make("1 ms");
    let ssh = client(&workshop);
    let inside = |node: &str, work: &dyn Fn() -> Running| {
        let _inside = lab.enter(node).unwrap();
        work()
    };
    let mut server = inside("base", &|| serve(&workshop, &found));
    let say = |arguments: &[&str]| -> Said {
        inside("desk", &|| Running::start(workshop.command_with_ssh(&ssh, arguments))).said()
    };
    by_ssh(&workshop, &say);
    let node = workshop.place.path("base/it's here");
    let config = node.join("current/config/robot.toml");
    let launch = || inside("base", &|| workshop.place.start(&["launch", config.to_str().unwrap()]));
    let mut first = launch();
    first.wait_for("bundle version 1 has passed its trial");
    first.stop();
    workshop.write_program("exit 3");
    workshop.make("24 h");
    say(&["bundle", "push", "source/config/bundles", "--to", NODE]).ok_with(["version 3, bundle ", "is current now"]);
    let mut bad = launch();
    bad.wait_for("node main of test runs: 1 module");
    let err = bad.err();
    assert!(err.contains("bundle version 3 did not start") && err.contains("; back to version 1"), "{err}");
    say(&["bundle", "check", NODE]).ok_with(["all files are as the manifest says"]);
    assert_eq!(current(node.to_str().unwrap()), 1);
    bad.stop();
    server.kill();
    workshop.place.assert_empty();
}
