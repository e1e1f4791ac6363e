//! The recorder is killed again and again while it writes, rotates, syncs, on a disk that fills and in a folder that
//! goes away. Each file is made whole, and each value that was sent is in one of them or counted as lost; but for those
//! that had not left the memory of a killed recorder, or came while there was none.
//!
//! With `ROHRPOST_MCAP_PYTHON`, a Python that has `mcap`, that reads all files, too, with all checksums:
//! `docs/src/proof.md` says how.

use crate::harness::{Place, Robot, times, until, wait};
use crate::recorded::{feed_until_recorded, launched_with, numbers};
use crate::recorded_control::{ControlConnection, controlled, own_address, told};
use crate::small_memory::{may_mount, with_small_memory};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rohrpost_recording::{info, is_closed, recover, recovered_path};
use rohrpost_testbed::report::skipped;
use std::fs::File;
use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

const ROLE: &str = "ROHRPOST_RECORDED_DISK";
const PYTHON: &str = "ROHRPOST_MCAP_PYTHON";
/// 256 MiB: 24 seconds of what is sent. A machine that is slower than that lets it run full in the wrong rounds, too.
const DISK_PAGES: usize = 65_536;
const TOPICS: [&str; 2] = ["feeder.0/count", "feeder.0/frame"];
/// More than it ever sends.
const ENDLESS: &str = "1000000000";

const LOGD: &str = r#"
[[module]]
name = "logd.0"
builtin = "logd"
stop-within = "60 s"
restart = { backoff = "50 ms", at-most = 1000, within = "50 ms" }
[module.mailbox.data]
slots = 1024
"#;

/// Files of a megabyte, and synced all the time.
const RECORD: &str = r#"
[record]
directory = "DISK/recordings"
streams = ["feeder.0/*"]
data = ["feeder.0/*"]
rotate-size = "1 MiB"
rotate-after = "1 s"
leave-free = "0 B"
flush = "2 ms"
sync = "4 ms"
"#;

/// What is wrong when it is killed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Trouble {
    Nothing,
    /// It was just told to begin the next file.
    Rotates,
    /// The disk takes no byte more.
    Full,
    /// Its folder has another name; so it can make no file, and tries again.
    Away,
}

const TROUBLES: [Trouble; 4] = [Trouble::Nothing, Trouble::Rotates, Trouble::Full, Trouble::Away];

fn trouble_of(round: u32) -> Trouble {
    TROUBLES[round as usize % TROUBLES.len()]
}

/// Not a test: the one below starts it where the disk is mounted.
#[test]
fn role() {
    if let Some(disk) = std::env::var_os(ROLE) {
        Torture::begin(Path::new(&disk)).run();
        println!("@ well");
    }
}

#[test]
fn a_recorder_that_is_killed_again_and_again_on_a_disk_that_fails_loses_nothing_uncounted() {
    if !may_mount() {
        return skipped("a recorder that is killed on a full disk; no mounts are allowed here");
    }
    let disk = tempfile::tempdir().unwrap();
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["recorded_killed::role", "--exact", "--nocapture", "--test-threads", "1"]).env(ROLE, disk.path());
    with_small_memory(&mut command, disk.path(), DISK_PAGES);
    let told = command.output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&told.stdout), String::from_utf8_lossy(&told.stderr));
    assert!(told.status.success() && out.contains("@ well"), "{out}\n{err}");
    println!("{out}");
}

/// What was found so far.
#[derive(Default, Debug)]
struct Tally {
    files: u64,
    recovered: u64,
    messages: u64,
    lost: u64,
}

struct Torture {
    place: Place,
    disk: PathBuf,
    address: SocketAddr,
    chance: ChaCha8Rng,
    /// The last value of each topic that is in a file.
    last: [u64; 2],
    tally: Tally,
}

impl Torture {
    fn begin(disk: &Path) -> Self {
        let seed = std::env::var("ROHRPOST_TEST_SEED")
            .ok()
            .map_or_else(|| u64::from(std::process::id()), |s| s.parse().unwrap());
        println!("ROHRPOST_TEST_SEED={seed}");
        let chance = ChaCha8Rng::seed_from_u64(seed);
        let address = own_address(21_123);
        Self { place: Place::new(), disk: disk.to_owned(), address, chance, last: [0; 2], tally: Tally::default() }
    }

    fn run(mut self) {
        let record = controlled(&RECORD.replace("DISK", self.disk.to_str().unwrap()), self.address);
        let (mut launch, robot) = launched_with(&self.place, LOGD, &record);
        feed_until_recorded(&self.place, "feeder.0");
        self.place.say(&["call", "feeder.0", "feed", ENDLESS]).ok();
        // For a long run: `ROHRPOST_KILLS=100 cargo test -p rohrpost-cli --test e2e recorded_killed`.
        let kills = times("ROHRPOST_KILLS", 10);
        for round in 0..kills {
            self.round(round, trouble_of(round), &robot);
            launch.assert_runs();
        }
        let began = self.root_files(kills);
        launch.stop();
        let folder = self.recordings().join(format!("round-{kills}"));
        let ended = [began, files(&folder)].concat();
        assert!(ended.iter().all(|file| is_closed(file).unwrap()), "it ended in order: {ended:?}");
        self.check(kills, &ended, 0, true);
        println!("killed {kills} times: {:?}", self.tally);
        assert!(kills < 4 || self.tally.recovered > 0, "no file was open when it was killed");
    }

    fn recordings(&self) -> PathBuf {
        self.disk.join("recordings")
    }

    /// Up to a time within this bound.
    fn pause(&mut self, most_us: u64) {
        std::thread::sleep(Duration::from_micros(self.chance.next_u64() % most_us));
    }

    /// Has the recorder go to the folder of a round. Files that it made before that, which are closed now; but for one
    /// that a disk took which was full again at once.
    fn root_files(&self, round: u32) -> Vec<PathBuf> {
        let folder = format!("round-{round}");
        until(format!("the recorder goes to {folder}"), || {
            let answer = ControlConnection::open(self.address).ask(&format!("directory {folder}"));
            answer.starts_with("OK ")
        });
        let kept = self.place.path(&format!("{folder}-before"));
        std::fs::create_dir(&kept).unwrap();
        let all = files(&self.recordings());
        let was_full = round.checked_sub(1).is_some_and(|before| trouble_of(before) == Trouble::Full);
        let whole = |file: &PathBuf| {
            let is_whole = is_closed(file).unwrap();
            assert!(is_whole || was_full, "round {round}: {}", file.display());
            let file = moved(file, &kept);
            if is_whole { file } else { recover(&file, &recovered_path(&file), &mut |_, _| {}).unwrap().path }
        };
        all.iter().map(whole).collect()
    }

    /// One incarnation of the recorder, from its beginning to its death.
    fn round(&mut self, round: u32, trouble: Trouble, robot: &Robot) {
        let name = format!("round-{round}");
        let began = self.root_files(round);
        let folder = self.recordings().join(&name);
        let mut control = ControlConnection::open(self.address);
        wait("it writes there", || {
            let answer = control.ask("status");
            (told(&answer, "file")?.contains(&name) && count(&answer, "bytes") > 0).then_some(())
        });
        self.pause(200_000);
        let (ballast, away) = (self.disk.join("ballast"), self.recordings().join(format!("{name}-away")));
        match trouble {
            Trouble::Nothing | Trouble::Rotates => {}
            Trouble::Full => fill(&ballast),
            Trouble::Away => std::fs::rename(&folder, &away).unwrap(),
        }
        if matches!(trouble, Trouble::Full | Trouble::Away) {
            wait("it tells the problem", || told(&control.ask("status"), "problem"));
            self.pause(100_000);
        }
        let known = control.ask("status");
        let written = count(&known, "written") - count(&known, "unsure");
        if trouble == Trouble::Rotates {
            control.say(b"rotate\n");
        }
        self.pause(4_000);
        robot.kill("logd.0");
        let _ = std::fs::remove_file(&ballast);
        self.remove_before(round);
        let left = if trouble == Trouble::Away { away } else { folder };
        let whole = self.whole(&left, trouble, &name);
        self.check(round, &[began, whole].concat(), written, false);
    }

    /// What was recovered there though nobody waited for it.
    fn remove_before(&self, round: u32) {
        for end in ["", "-away"] {
            let folder = round.checked_sub(1).map(|before| self.recordings().join(format!("round-{before}{end}")));
            let _ = folder.map(std::fs::remove_dir_all);
        }
    }

    /// All files that a killed recorder left, moved away; for each that it could not close, a whole one.
    fn whole(&mut self, left: &Path, trouble: Trouble, name: &str) -> Vec<PathBuf> {
        let kept = self.place.path(name);
        std::fs::create_dir(&kept).unwrap();
        let mut all = Vec::new();
        for file in files(left).iter().filter(|file| !is_recovered(file)) {
            match is_closed(file) {
                Ok(true) => all.push(moved(file, &kept)),
                Ok(false) => {
                    // A disk that is full has no room for one, and the recorder says so.
                    if trouble != Trouble::Full {
                        let made = recovered_path(file);
                        until(format!("{} is there", made.display()), || made.exists());
                        all.push(moved(&made, &kept));
                    }
                    let file = moved(file, &kept);
                    if trouble == Trouble::Full {
                        let made = recovered_path(&file);
                        recover(&file, &made, &mut |_, _| {}).unwrap();
                        all.push(made);
                    }
                    self.tally.recovered += 1;
                }
                // It was killed before it had written where the file begins.
                Err(_) => assert!(file.metadata().unwrap().len() < 100, "{}", file.display()),
            }
        }
        all
    }

    /// What one incarnation left: in order, nothing twice, nothing missing uncounted, and all that it had told
    /// to be written.
    fn check(&mut self, round: u32, all: &[PathBuf], written: u64, has_ended: bool) {
        let told: Vec<_> = all.iter().map(|file| info(file).unwrap()).collect();
        let found: u64 = told.iter().map(|info| info.messages).sum();
        assert!(found >= written, "round {round}: {written} were told to be written, {found} are there: {all:?}");
        for (topic, last) in TOPICS.iter().zip(&mut self.last) {
            let lost: u64 =
                told.iter().flat_map(|info| &info.channels).filter(|its| its.topic == *topic).map(|its| its.lost).sum();
            let numbers: Vec<u64> = all.iter().flat_map(|file| numbers(file, topic)).collect();
            let (Some(first), Some(newest)) = (numbers.first(), numbers.last()) else { continue };
            assert!(numbers.is_sorted_by(|a, b| a < b), "round {round}, {topic}: {numbers:?}");
            assert!(first > last, "round {round}, {topic}: {first} was there before");
            let missing = newest - first + 1 - numbers.len() as u64;
            // Of a killed one, what was lost may be behind the last value that is there.
            let is_right = if has_ended { missing == lost } else { missing <= lost };
            assert!(is_right, "round {round}, {topic}: {missing} are missing, {lost} counted; {all:?}");
            *last = *newest;
            self.tally.lost += lost;
        }
        python(all);
        self.tally.files += all.len() as u64;
        self.tally.messages += found;
        all.iter().for_each(|file| std::fs::remove_file(file).unwrap());
    }
}

/// Recordings in a folder, in order of their numbers; not those in folders below.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    let mut all: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "mcap")).collect();
    all.sort();
    all
}

fn is_recovered(file: &Path) -> bool {
    file.to_str().unwrap().ends_with(".recovered.mcap")
}

/// To another disk. Where it is then.
fn moved(file: &Path, to: &Path) -> PathBuf {
    let there = to.join(file.file_name().unwrap());
    std::fs::copy(file, &there).unwrap();
    std::fs::remove_file(file).unwrap();
    there
}

/// Takes all room that is left.
fn fill(ballast: &Path) {
    let mut file = File::create(ballast).unwrap();
    for size in [1 << 16, 1 << 12] {
        while file.write_all(&vec![0; size]).is_ok() {}
    }
}

fn count(answer: &str, key: &str) -> u64 {
    told(answer, key).and_then(|count| count.parse().ok()).unwrap_or_default()
}

/// Python's reader finds as many messages of each topic as we do, and all checksums right.
fn python(all: &[PathBuf]) {
    let Some(python) = std::env::var_os(PYTHON) else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../modules/recording/tests/python/read.py");
    let told = Command::new(python).arg("-B").arg(script).args(all).output().unwrap();
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    let ours = all.iter().map(|path| {
        let told = info(path).unwrap();
        let channels =
            told.channels.iter().map(|channel| format!(" {}={}", channel.topic, channel.messages + channel.repeated));
        format!("{}{}\n", told.messages + told.repeated, channels.collect::<String>())
    });
    assert_eq!(String::from_utf8(told.stdout).unwrap(), ours.collect::<String>());
}
