//! Scans of a real log between its odometry: for each the right two records or the right reason, compared with a script
//! that reads the log itself (`python/odometry_around.py`), in the order of the log and in others within the bound.
//!
//! `ROHRPOST_CARMEN_LOG=FILE` names another log than the small one that is here.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rohrpost_modules::fusion::{Around, History, NoValue, Records, Refused, Stamp};
use rohrpost_modules::types::Odometry;
use rohrpost_robot::carmen::{self, LogRecord, Settings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Times asked for, from the stamp of each scan: its own, and some between the small log's records.
const OFFSETS_NS: [i64; 3] = [-60_000_000, 0, 37_000_000];
/// More than any log here has: nothing is forgotten.
const CAPACITY: usize = 100_000;

fn log() -> PathBuf {
    let small = || Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/small.log.gz");
    std::env::var_os("ROHRPOST_CARMEN_LOG").map_or_else(small, PathBuf::from)
}

/// A line with a stamp.
#[derive(Clone)]
enum Line {
    Odometry { line: u64, stamp: Stamp, odometry: Odometry },
    Scan { line: u64, stamp: Stamp },
}

impl Line {
    fn stamp(&self) -> Stamp {
        match self {
            Self::Odometry { stamp, .. } | Self::Scan { stamp, .. } => *stamp,
        }
    }
}

fn read(path: &Path) -> Vec<Line> {
    let mut reader = carmen::open(path, Settings::default()).unwrap();
    let mut lines = Vec::new();
    while let Some(record) = reader.next() {
        let line = reader.line();
        let Ok(record) = record else { continue };
        let Some(stamp_s) = record.stamp_s() else { continue };
        let stamp = Stamp::new(1, (stamp_s * 1e9).round() as u64);
        lines.push(match record {
            LogRecord::Odometry { odometry, .. } => Line::Odometry { line, stamp, odometry },
            LogRecord::Scan { .. } => Line::Scan { line, stamp },
            LogRecord::Param { .. } => continue,
        });
    }
    lines
}

/// What is asked for, and the answer in the script's words.
struct Asked {
    line: u64,
    offset_ns: i64,
    stamp: Stamp,
    answer: Option<String>,
}

/// Asks for each scan as soon as it has come, and again until the answer is final.
struct Asking {
    history: History<Odometry>,
    gap_max_ns: u64,
    open: Vec<Asked>,
    answers: BTreeMap<(u64, i64), String>,
    late: usize,
}

impl Asking {
    fn new(lateness_ns: u64, gap_max_ns: u64) -> Self {
        let history = History::new(CAPACITY, lateness_ns);
        Self { history, gap_max_ns, open: Vec::new(), answers: BTreeMap::new(), late: 0 }
    }

    /// Takes a line; false if it is too late.
    fn take(&mut self, line: &Line) -> bool {
        match line {
            Line::Odometry { line, stamp, odometry } => match self.history.push(*stamp, *line, *odometry) {
                Ok(()) => {}
                Err(Refused::Late { .. }) => {
                    self.late += 1;
                    return false;
                }
                Err(other) => panic!("line {line}: {other}"),
            },
            Line::Scan { line, stamp } => self.open.extend(OFFSETS_NS.map(|offset_ns| {
                let stamp = Stamp { ns: stamp.ns.checked_add_signed(offset_ns).unwrap(), ..*stamp };
                Asked { line: *line, offset_ns, stamp, answer: None }
            })),
        }
        let mut open = std::mem::take(&mut self.open);
        for asked in &mut open {
            asked.answer = self.answer(asked.stamp, true);
        }
        for asked in open {
            match asked.answer {
                Some(answer) => drop(self.answers.insert((asked.line, asked.offset_ns), answer)),
                None => self.open.push(asked),
            }
        }
        true
    }

    /// None: not yet, when only a final answer is wanted.
    fn answer(&self, stamp: Stamp, is_final: bool) -> Option<String> {
        let line = |position| self.history.record(position).unwrap().sequence;
        Some(match self.history.around(stamp, self.gap_max_ns) {
            Err(NoValue::NotYet { .. } | NoValue::Empty) if is_final => return None,
            Ok(Around::At(at)) => format!("at {}", line(at)),
            Ok(Around::Between { before, after, .. }) => format!("between {} {}", line(before), line(after)),
            Err(NoValue::Empty) => "empty".to_owned(),
            Err(NoValue::NotYet { by_ns }) => format!("not yet {by_ns}"),
            Err(NoValue::BeforeOldest { by_ns }) => format!("before {by_ns}"),
            Err(NoValue::Gap { gap_ns, .. }) => format!("gap {gap_ns}"),
            Err(other @ NoValue::OtherEpoch { .. }) => panic!("{other}"),
        })
    }

    /// All answers at the end of the log, as the script prints them.
    fn finish(mut self) -> String {
        for asked in &self.open {
            let answer = self.answer(asked.stamp, false).unwrap();
            self.answers.insert((asked.line, asked.offset_ns), answer);
        }
        let kept = self.history.positions().end;
        let mut text = format!("{kept} odometry records, {} too late\n", self.late);
        for ((line, offset_ns), answer) in &self.answers {
            text += &format!("{line} {offset_ns:+} {answer}\n");
        }
        text
    }
}

fn script(path: &Path, lateness_ns: u64, gap_max_ns: u64) -> String {
    let mut command = Command::new("python3");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/odometry_around.py")).arg(path);
    command.args([lateness_ns, gap_max_ns].map(|ns| ns.to_string())).args(OFFSETS_NS.map(|ns| ns.to_string()));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The first line that differs, with both.
fn assert_same(found: &str, expected: &str, what: &str) {
    let differs = found.lines().zip(expected.lines()).find(|(found, expected)| found != expected);
    assert_eq!(differs, None, "{what}: left is ours, right is the script's");
    assert_eq!(found.lines().count(), expected.lines().count(), "{what}");
}

/// A log that has three records of one stamp, lines that stand there twice, and records behind others by less and by
/// more than the bound.
#[test]
fn equal_late_and_repeated_stamps_are_taken_as_the_log_has_them() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/stamps.log");
    let lines = read(&path);
    for (lateness_ns, gap_max_ns, late_wanted) in
        [(10_000_000, 500_000_000, 6), (200_000_000, 500_000_000, 3), (300_000_000, 1_000_000_000, 0)]
    {
        let mut asking = Asking::new(lateness_ns, gap_max_ns);
        for line in &lines {
            asking.take(line);
        }
        assert_eq!(asking.late, late_wanted, "bound {lateness_ns} ns");
        assert_same(&asking.finish(), &script(&path, lateness_ns, gap_max_ns), &format!("bound {lateness_ns} ns"));
    }
}

#[test]
fn each_scan_gets_the_right_two_records_or_the_right_reason() {
    let path = log();
    let lines = read(&path);
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    for (lateness_ns, gap_max_ns) in [(0, 500_000_000), (300_000_000, 500_000_000), (300_000_000, 50_000_000)] {
        let expected = script(&path, lateness_ns, gap_max_ns);
        for answer in expected.lines().skip(1).filter_map(|line| line.split(' ').nth(2)) {
            *kinds.entry(answer.to_owned()).or_default() += 1;
        }
        let mut in_order = Asking::new(lateness_ns, gap_max_ns);
        let taken: Vec<Line> = lines.iter().filter(|line| in_order.take(line)).cloned().collect();
        let late = in_order.late;
        assert_same(&in_order.finish(), &expected, &format!("bound {lateness_ns} ns, in order"));
        for seed in 0..4 {
            let mut chance = ChaCha8Rng::seed_from_u64(seed);
            let mut shuffled: Vec<_> =
                taken.iter().map(|line| (line.stamp().ns + chance.random_range(0..lateness_ns.max(1)), line)).collect();
            shuffled.sort_by_key(|(due_ns, _)| *due_ns);
            let mut asking = Asking::new(lateness_ns, gap_max_ns);
            assert!(shuffled.iter().all(|(_, line)| asking.take(line)), "within the bound, none is late");
            asking.late = late;
            assert_same(&asking.finish(), &expected, &format!("bound {lateness_ns} ns, shuffled by seed {seed}"));
        }
    }
    println!("{}: {kinds:?}", path.display());
    assert!(["at", "between", "gap"].iter().all(|kind| kinds.contains_key(*kind)), "{kinds:?}");
}
