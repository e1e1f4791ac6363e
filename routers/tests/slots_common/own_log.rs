//! What a node says of its slots and its time, written to a file again and again: also by a process that is killed.

use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_mailbox::{TimeRecord, TimeSource, monotonic_ns};
use rohrpost_routers::driver::{Used, WINDOWS};
use rohrpost_routers::shell::Shell;
use rohrpost_routers::shell::clock::ClockState;
use rohrpost_routers::shell::slots::SlotStatus;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// It looks so often. What it remembers of windows lasts for many times as long.
pub(crate) const EVERY: Duration = Duration::from_millis(5);
/// Two cycles.
const NEAR_NS: u64 = 20_000_000;

/// Ends with the router.
pub(crate) struct Recorder {
    ends: Arc<AtomicBool>,
}

impl Recorder {
    /// Begins to write down what a router says.
    pub(crate) fn start(folder: &Path, own: u8, shell: &Shell) -> Self {
        let path = folder.join(format!("{own}.{}.log", shell.settings().incarnation));
        let file = OpenOptions::new().create_new(true).append(true).open(path).unwrap();
        let (slots, clock) = (shell.slots().unwrap().clone(), shell.clock().unwrap().clone());
        let ends = Arc::new(AtomicBool::new(false));
        let ending = ends.clone();
        std::thread::spawn(move || {
            // Where it is not allowed it may miss some windows, and says so.
            let _ = schedule(Scheduling::Fifo(1));
            record(file, &slots, &clock, &ending);
        });
        Self { ends }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
    }
}

fn record(mut file: File, slots: &SlotStatus, clock: &ClockState, ends: &AtomicBool) {
    let mut last: Option<Used> = None;
    loop {
        // Once more behind the end: all that was done is told then.
        let is_last = ends.load(Ordering::Relaxed);
        let at_ns = monotonic_ns();
        let (seen, clock) = (slots.snapshot(), clock.snapshot());
        let used: Vec<Used> = seen.log.windows.iter().flatten().copied().collect();
        let known = last.and_then(|last| used.iter().rposition(|used| used.window == last.window));
        let is_gap = known.is_none() && used.len() == WINDOWS;
        let counts = seen.counts;
        let left_out = counts.late + counts.skipped + counts.silent + seen.log.held + seen.log.behind;
        let TimeRecord { epoch, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s, .. } = clock.record;
        let mut line = format!(
            "{at_ns} {epoch} {monotonic_ns} {system_ns} {pace_ppb} {error_ns} {drift_ns_s} {} {left_out} {}",
            clock.master.unwrap_or(u8::MAX),
            u8::from(is_gap)
        );
        for Used { window, spare_ns, over_ns, .. } in &used[known.map_or(0, |known| known + 1)..] {
            line += &format!(" {} {} {spare_ns} {over_ns}", window.begin_ns, window.end_ns);
        }
        // In one piece: a process that is killed leaves whole lines.
        file.write_all((line + "\n").as_bytes()).unwrap();
        last = used.last().copied().or(last);
        if is_last {
            return;
        }
        std::thread::sleep(EVERY);
    }
}

/// A window that a node has used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct OwnWindow {
    /// System time.
    pub(crate) begin_ns: u64,
    pub(crate) end_ns: u64,
    /// As in [`Used`].
    pub(crate) spare_ns: i64,
    pub(crate) over_ns: u64,
}

/// One look.
#[derive(Clone, Debug)]
pub(crate) struct Look {
    pub(crate) at_ns: u64,
    time: TimeRecord,
    /// Its master; 255: none.
    master: u64,
    /// Slots so far that were left out, began too late or took too long, and datagrams that missed theirs.
    pub(crate) left_out: u64,
    /// Windows are missing before those of this look.
    pub(crate) is_gap: bool,
    /// Used since the last look.
    pub(crate) windows: Vec<OwnWindow>,
}

impl Look {
    fn of(line: &str) -> Self {
        let mut words = line.split(' ');
        let mut next = || words.next().map(|word| word.parse::<i128>().unwrap());
        let head: [i128; 10] = std::array::from_fn(|_| next().unwrap());
        let [at_ns, epoch, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s, master, left_out, is_gap] =
            head.map(|number| number as u64);
        let source = TimeSource::Master;
        let time = TimeRecord { epoch, source, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s };
        let window = || {
            let (begin_ns, mut next) = (next()? as u64, || next().unwrap());
            let end_ns = next() as u64;
            Some(OwnWindow { begin_ns, end_ns, spare_ns: next() as i64, over_ns: next() as u64 })
        };
        Self { at_ns, time, master, left_out, is_gap: is_gap > 0, windows: std::iter::from_fn(window).collect() }
    }
}

/// What a node has said so far: of each of its routers, in order.
pub(crate) struct OwnLog(Vec<Vec<Look>>);

impl OwnLog {
    pub(crate) fn read(folder: &Path, own: u8) -> Self {
        let prefix = format!("{own}.");
        let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
        let is_own = |path: &PathBuf| {
            let name = path.file_name().unwrap().to_str().unwrap();
            name.starts_with(&prefix) && name.ends_with(".log")
        };
        let looks = |path: PathBuf| {
            let text = std::fs::read_to_string(path).unwrap();
            // One that is being written has no end yet.
            text.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n')).map(Look::of).collect()
        };
        let mut routers: Vec<Vec<Look>> = files.filter(is_own).map(looks).collect();
        routers.retain(|looks| !looks.is_empty());
        routers.sort_by_key(|looks| looks[0].at_ns);
        Self(routers)
    }

    fn looks(&self) -> impl Iterator<Item = &Look> {
        self.0.iter().flatten()
    }

    pub(crate) fn windows(&self) -> impl Iterator<Item = OwnWindow> {
        self.looks().flat_map(|look| look.windows.iter().copied())
    }

    /// When it was looked at last.
    pub(crate) fn told_ns(&self) -> u64 {
        self.looks().last().map_or(0, |look| look.at_ns)
    }

    /// Whether it counted between these moments that it left a slot out, began one too late, took too long in one,
    /// missed or overran one.
    pub(crate) fn has_left_out(&self, since_ns: u64, until_ns: u64) -> bool {
        let until_ns = until_ns + 2 * EVERY.as_nanos() as u64;
        let before = self.looks().take_while(|look| look.at_ns <= since_ns).last().map_or(0, |look| look.left_out);
        let has_overrun = |look: &Look| look.windows.iter().any(|window| window.over_ns > 0);
        let mut within = self.looks().filter(|look| (since_ns + 1..until_ns).contains(&look.at_ns));
        within.any(|look| look.left_out != before || has_overrun(look))
    }

    /// When it was first seen to follow this master, from this moment on.
    pub(crate) fn follows_ns(&self, master: u8, since_ns: u64) -> Option<u64> {
        let mut looks = self.looks().skip_while(|look| look.at_ns < since_ns);
        looks.find(|look| look.master == master.into()).map(|look| look.at_ns)
    }

    /// When it was seen to follow another master than at this moment.
    pub(crate) fn turned_ns(&self, since_ns: u64) -> Option<u64> {
        let mut looks = self.looks().skip_while(|look| look.at_ns < since_ns);
        let before = looks.next()?.master;
        looks.find(|look| look.master != before).map(|look| look.at_ns)
    }

    /// To be shown: looks with windows in the cycles around a moment of system time, or before which some are missing.
    pub(crate) fn near(&self, system_ns: u64) -> Vec<&Look> {
        let is_near = |window: &OwnWindow| window.begin_ns.abs_diff(system_ns) < NEAR_NS;
        self.looks().filter(|look| look.is_gap || look.windows.iter().any(is_near)).collect()
    }

    /// System time at a moment of this node's own clock, as it knew it then: by the last record that had begun. On a
    /// busy computer a later look may be the first that saw it.
    pub(crate) fn system_ns(&self, local_ns: u64) -> u64 {
        let begun = self.looks().filter(|look| look.time.monotonic_ns <= local_ns).last();
        begun.or_else(|| self.looks().next()).map_or(0, |look| look.time.at(local_ns).ns)
    }
}
