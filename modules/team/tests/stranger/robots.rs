//! Robots in both languages, and in both at once.

use rohrpost_team::group::{GroupSettings, Hello};
use rohrpost_team::view::{Records, ViewSettings};
use rohrpost_team::{Position, RobotId, Team, TeamSettings};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

pub(crate) const BEAT_NS: u64 = 500_000_000;
const MAX_AGE_NS: u64 = BEAT_NS * 75 / 10;
const MAP: u64 = 7;

/// A program that answers each line by one: see `team_lines.py`.
pub(crate) struct Stranger {
    child: Child,
    asks: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Stranger {
    pub(crate) fn new() -> Self {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/e2e/python/team_lines.py");
        let mut command = Command::new("python3");
        let mut child = command.args(["-B", page]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (asks, answers) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        Self { child, asks, answers }
    }

    pub(crate) fn ask(&mut self, line: &str) -> String {
        writeln!(self.asks, "{line}").unwrap();
        let mut answer = String::new();
        self.answers.read_line(&mut answer).unwrap();
        assert!(answer.ends_with('\n'), "it has ended");
        answer.trim_end().to_owned()
    }
}

impl Drop for Stranger {
    fn drop(&mut self) {
        self.child.kill().and_then(|()| self.child.wait()).unwrap();
    }
}

/// A robot in either language, or the same one in both, which hear the same and have to say the same.
pub(crate) enum Robot {
    Rust(Box<Team>),
    Python(Stranger),
    Twins(Box<Robot>, Box<Robot>),
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn unhex(text: &str) -> Vec<u8> {
    text.as_bytes().chunks(2).map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

/// A message without what a robot in Python does not know: the leader's clock.
#[derive(PartialEq, Debug)]
pub(crate) enum Message {
    Hello(Hello),
    Records(Records),
}

pub(crate) fn readable(bytes: &[u8]) -> Message {
    if bytes[0] == b'H' {
        Message::Hello(Hello { reference: None, ..Hello::decode(bytes).unwrap() })
    } else {
        Message::Records(Records::decode(bytes).unwrap())
    }
}

/// What a robot knows: leader and group, whether all have its view, digests.
#[derive(PartialEq, Debug)]
pub(crate) struct Known {
    pub(crate) pair: (u8, u8),
    pub(crate) agrees: bool,
    pub(crate) digests: Vec<u32>,
}

impl Robot {
    pub(crate) fn rust(id: RobotId) -> Self {
        let view = ViewSettings {
            gate_mm: 500,
            sightings: 1,
            certainty_max_age_ns: 600_000_000_000,
            intruder_max_age_ns: 6_000_000_000_000,
            friend_max_age_ns: 30_000_000_000,
            friend_radius_mm: 300,
            speed_max_mm_s: 1000,
        };
        let group = GroupSettings { beat_ns: BEAT_NS, max_age_ns: MAX_AGE_NS };
        let settings = TeamSettings { group, view, drift_ppb: 60_000, clock_off_ns: 1_000_000_000 };
        Self::Rust(Box::new(Team::new(id, 1, MAP, settings)))
    }

    pub(crate) fn python(id: RobotId, incarnation: u32) -> Self {
        let mut stranger = Stranger::new();
        stranger.ask(&format!("robot {id} {incarnation} {MAP} {BEAT_NS} {MAX_AGE_NS}"));
        Self::Python(stranger)
    }

    pub(crate) fn twins(id: RobotId) -> Self {
        Self::Twins(Box::new(Self::rust(id)), Box::new(Self::python(id, 1)))
    }

    pub(crate) fn beat(&mut self, now_ns: u64) -> Vec<Vec<u8>> {
        match self {
            Self::Twins(rust, python) => {
                let said = rust.beat(now_ns);
                assert_eq!(
                    said.iter().map(|it| readable(it)).collect::<Vec<_>>(),
                    python.beat(now_ns).iter().map(|it| readable(it)).collect::<Vec<_>>()
                );
                said
            }
            Self::Rust(team) => {
                let beat = team.beat(now_ns, None);
                let records = [beat.objects, beat.synchro].into_iter().flatten().map(|records| records.encode());
                records.chain([beat.hello.encode()]).collect()
            }
            Self::Python(it) => it.ask(&format!("beat {now_ns}")).split(' ').map(unhex).collect(),
        }
    }

    pub(crate) fn hear(&mut self, now_ns: u64, bytes: &[u8]) {
        match self {
            Self::Twins(rust, python) => [rust, python].into_iter().for_each(|twin| twin.hear(now_ns, bytes)),
            Self::Rust(team) if bytes[0] == b'H' => team.hear_hello(now_ns, &Hello::decode(bytes).unwrap()),
            Self::Rust(team) => team.hear_records(now_ns, Records::decode(bytes).unwrap()),
            Self::Python(it) => drop(it.ask(&format!("hear {now_ns} {}", hex(bytes)))),
        }
    }

    pub(crate) fn see(&mut self, now_ns: u64, position: Position) {
        match self {
            Self::Twins(rust, python) => [rust, python].into_iter().for_each(|twin| twin.see(now_ns, position)),
            Self::Rust(team) => team.look(now_ns, &[position], |_| false),
            Self::Python(it) => drop(it.ask(&format!("see {now_ns} {} {}", position.x_mm, position.y_mm))),
        }
    }

    pub(crate) fn known(&mut self, now_ns: u64) -> Known {
        match self {
            Self::Twins(rust, python) => {
                let known = rust.known(now_ns);
                assert_eq!(known, python.known(now_ns));
                known
            }
            Self::Rust(team) => {
                let (leader, group) = (team.group().leader(now_ns), team.group().group(now_ns));
                let digests = team.view().digests().to_vec();
                Known { pair: (leader.get(), group.get()), agrees: team.agrees(now_ns), digests }
            }
            Self::Python(it) => {
                let answer = it.ask(&format!("tell {now_ns}"));
                let words: Vec<u32> = answer.split(' ').map(|word| word.parse().unwrap()).collect();
                let [leader, group, agrees, _, digests @ ..] = &words[..] else { panic!("{answer}") };
                Known { pair: (*leader as u8, *group as u8), agrees: *agrees == 1, digests: digests.to_vec() }
            }
        }
    }
}
