//! `rohrpost doctor`: whether this computer lets a robot run in time, and what would mend it.

mod kernel;
mod machine;
mod measure;
mod network;
mod place;
mod rights;

use super::{Failure, say};
use machine::{Machine, Needs};
use rohrpost::launch::choose_node;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost doctor                            what this computer allows
  rohrpost doctor --config robot.toml        and whether that suffices for this configuration
  rohrpost doctor --measure                  and how late a thread wakes up, in one second
Ends with 1 if something is bad. Changes nothing.")]
pub(super) struct Arguments {
    /// Configuration that is to run here.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Node of the configuration, if it has several.
    #[arg(long, value_name = "NAME", requires = "config")]
    node: Option<String>,
    /// Measure for a second how late a thread wakes up.
    #[arg(long)]
    measure: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// How good something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum State {
    Ok,
    /// A robot runs, and may be late.
    Warn,
    /// It does not run, or not for long.
    Bad,
}

impl State {
    fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }
}

/// One thing that was looked at.
#[derive(Debug)]
struct Finding {
    what: &'static str,
    state: State,
    /// What is.
    is: String,
    /// Why it matters.
    why: &'static str,
    /// What mends it: a command, if one does.
    mend: Option<String>,
}

impl Finding {
    fn ok(what: &'static str, is: impl Into<String>, why: &'static str) -> Self {
        Self { what, state: State::Ok, is: is.into(), why, mend: None }
    }

    /// Something that is not as it should be, and what mends it.
    fn not(
        state: State,
        what: &'static str,
        is: impl Into<String>,
        why: &'static str,
        mend: impl Into<String>,
    ) -> Self {
        Self { what, state, is: is.into(), why, mend: Some(mend.into()) }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let (mut needs, mut lan) = (Needs::default(), None);
    if let Some(file) = &arguments.config {
        let installation = super::check::load(file)?;
        let node = choose_node(&installation, arguments.node.as_deref())?;
        needs = Needs::of(&installation, node);
        lan = network::ask(&installation, node);
    }
    let mut findings = examine(&Machine::this(&needs, lan), &needs);
    if arguments.measure {
        findings.push(measure::wake_up(needs.priority));
    }
    if arguments.json {
        say(json(&findings));
    } else {
        say(page(&findings));
    }
    let bad = findings.iter().any(|finding| finding.state == State::Bad);
    Ok(if bad { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn examine(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let mut findings = kernel::findings(machine);
    findings.extend(rights::findings(machine, needs));
    findings.extend(place::findings(machine, needs));
    findings.extend(network::findings(machine, needs));
    findings
}

/// Where the words of a finding begin.
const INDENT: usize = 24;

fn page(findings: &[Finding]) -> String {
    let mut text = String::new();
    for Finding { what, state, is, why, mend } in findings {
        text += &format!("{:4}  {what:<width$}{is}\n", state.name(), width = INDENT - 6);
        text += &format!("{:INDENT$}{why}\n", "");
        if let Some(mend) = mend {
            text += &format!("{:INDENT$}mend: {mend}\n", "");
        }
    }
    let count = |state| findings.iter().filter(|finding| finding.state == state).count();
    text + &format!("\n{} ok, {} warnings, {} bad", count(State::Ok), count(State::Warn), count(State::Bad))
}

fn json(findings: &[Finding]) -> serde_json::Value {
    let worst = findings.iter().map(|finding| finding.state).max().unwrap_or(State::Ok);
    let findings = findings.iter().map(|Finding { what, state, is, why, mend }| {
        serde_json::json!({ "what": what, "state": state.name(), "is": is, "why": why, "mend": mend })
    });
    serde_json::json!({ "state": worst.name(), "findings": findings.collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests {
    use super::machine::{Asked, NodeFound, Seen};
    use super::network::{Lan, Peer, Port, PortState, Reach, Stamps};
    use super::*;
    use rohrpost::mailbox::{LAYOUT_VERSION, sys::Room};
    use std::fs;
    use std::path::Path;

    /// Unpacks a computer that was written down: lines `== PATH`, each followed by what the file holds.
    fn unpack(text: &str, to: &Path) {
        for file in text.split("\n== ").skip(1) {
            let (path, content) = file.split_once('\n').unwrap_or((file, ""));
            let path = to.join(path.trim_start_matches('/'));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, content).unwrap();
        }
    }

    fn said(name: &str, asked: Asked, needs: &Needs) -> String {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/doctor");
        let root = tempfile::tempdir().unwrap();
        unpack(&fs::read_to_string(folder.join(format!("{name}.machine"))).unwrap(), root.path());
        page(&examine(&Machine::at(root.path(), asked), needs)) + "\n"
    }

    /// `UPDATE_GOLDEN=1 cargo test --bin rohrpost doctor` writes the texts anew; read the difference before you commit.
    fn compare(name: &str, said: &str) {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/doctor/{name}.txt"));
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            fs::write(&golden, said).unwrap();
        }
        assert_eq!(said, fs::read_to_string(&golden).unwrap(), "{}", golden.display());
    }

    fn lan(ports: [PortState; 2], peers: &[(&str, u32, Reach)]) -> Lan {
        let [packages, time] = ports;
        let peer = |(host, (name, mtu, reach)): (u8, &(&str, u32, Reach))| Peer {
            name: (*name).into(),
            address: [10, 77, 0, host].into(),
            mtu: Some(*mtu),
            reach: reach.clone(),
        };
        Lan {
            node: "base".into(),
            address: [10, 77, 0, 1].into(),
            mtu: 1500,
            is_here: true,
            addresses: vec![("eth0".into(), [10, 77, 0, 1].into())],
            ports: [Port { number: 21117, state: packages }, Port { number: 21118, state: time }],
            runs: true,
            stamps: Stamps::Both,
            peers: (2..).zip(peers).map(peer).collect(),
        }
    }

    fn lan_that_works() -> Lan {
        lan([PortState::InUse, PortState::Free], &[("arm", 1500, Reach::NoRouter), ("desk", 9000, Reach::Neighbour)])
    }

    fn lan_of_trouble() -> Lan {
        let no_way = Reach::NoWay("Network is unreachable (os error 101)".into());
        let refused = PortState::Refused("Permission denied (os error 13)".into());
        Lan {
            is_here: false,
            addresses: vec![("eth0".into(), [192, 168, 0, 7].into()), ("wlan0".into(), "fd00::7".parse().unwrap())],
            runs: false,
            stamps: Stamps::NoSent,
            ..lan([PortState::InUse, refused], &[("arm", 1280, Reach::Silent), ("desk", 1500, no_way)])
        }
    }

    #[test]
    fn a_computer_made_for_a_robot() {
        let asked = Asked {
            fifo: Ok(()),
            base: "/dev/shm/rohrpost-1000".into(),
            room: Some(Room { bytes: 8 << 30, free: 7 << 30 }),
            nodes: vec![NodeFound { path: "/dev/shm/rohrpost-1000/arm.main".into(), seen: Seen::Launched(812) }],
            bridge: Some("/opt/rohrpost/rohrpost-gui-bridge".into()),
            viewer: Some("/usr/local/bin/rerun".into()),
            lan: Some(lan_that_works()),
        };
        let needs = Needs { priority: 34, memory: 4 << 20, gui: true, processes: 6, from: Some("robot.toml".into()) };
        let said = said("good", asked, &needs);
        // What this version of Rohrpost lacks, no computer mends.
        let warnings = said.lines().filter(|line| line.starts_with("warn"));
        assert!(
            warnings.eq(["warn  network security  none, as robot.toml says"]) && !said.contains("\nbad "),
            "{said}"
        );
        compare("good", &said);
    }

    #[test]
    fn a_computer_on_which_all_is_wrong() {
        let asked = Asked {
            fifo: Err("Operation not permitted (os error 1)".into()),
            base: "/home/robot/nodes".into(),
            room: Some(Room { bytes: 64 << 20, free: 1 << 20 }),
            nodes: vec![
                NodeFound { path: "/home/robot/nodes/demo.main".into(), seen: Seen::Dead },
                NodeFound { path: "/home/robot/nodes/old.main".into(), seen: Seen::OtherVersion(99) },
            ],
            bridge: None,
            viewer: None,
            lan: Some(lan_of_trouble()),
        };
        let needs = Needs { priority: 34, memory: 40 << 20, gui: true, processes: 6, from: Some("robot.toml".into()) };
        let said = said("bad", asked, &needs);
        // The version of the layout goes its own way.
        compare("bad", &said.replace(&format!("this program {LAYOUT_VERSION}"), "this program …"));
    }

    /// As the unit for systemd has it, in /run: what holds there is told of /run, not of /dev/shm.
    #[test]
    fn a_computer_with_too_little_room_in_run() {
        let asked = Asked {
            fifo: Ok(()),
            base: "/run/rohrpost/main".into(),
            room: Some(Room { bytes: 64 << 20, free: 60 << 20 }),
            nodes: Vec::new(),
            bridge: None,
            viewer: None,
            lan: None,
        };
        let needs = Needs { memory: 70 << 20, from: Some("robot.toml".into()), ..Needs::default() };
        compare("run", &said("run", asked, &needs));
    }

    #[test]
    fn a_node_whose_address_is_elsewhere() {
        let asked = Asked {
            fifo: Ok(()),
            base: "/dev/shm/rohrpost-0".into(),
            room: None,
            nodes: Vec::new(),
            bridge: None,
            viewer: None,
            lan: Some(Lan {
                addresses: Vec::new(),
                stamps: Stamps::None("Protocol not available".into()),
                ..Lan { is_here: false, ..lan([PortState::Unknown, PortState::Unknown], &[]) }
            }),
        };
        let needs = Needs { from: Some("robot.toml".into()), ..Needs::default() };
        let said = said("silent", asked, &needs);
        let network = said.split_once("warn  network security").unwrap().1;
        compare("elsewhere", &format!("warn  network security{network}"));
    }

    /// What a kernel does not tell is not guessed at.
    #[test]
    fn a_computer_that_tells_nothing() {
        let asked = Asked {
            fifo: Ok(()),
            base: "/dev/shm/rohrpost-0".into(),
            room: None,
            nodes: Vec::new(),
            bridge: None,
            viewer: None,
            lan: None,
        };
        let said = said("silent", asked, &Needs::default());
        assert!(!said.contains("\nbad "), "{said}");
        compare("silent", &said);
    }
}
