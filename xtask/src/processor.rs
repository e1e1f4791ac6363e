//! Processor time, user's and kernel's: what a build or a test costs, also on a machine that does other things.
//!
//! The kernel adds a process's time to that of its parent when the parent waits for it. So what a stage has left
//! running, and what ended without a parent that waits, is not counted.

use std::time::Duration;

/// The unit of `/proc/PID/stat` is 1/100 s on every machine (`USER_HZ`, see proc(5) and time(7)).
const TICK: Duration = Duration::from_millis(10);

/// Of all children of this process that it has waited for, and theirs.
pub(crate) fn of_ended_children() -> Duration {
    times("self").map_or(Duration::ZERO, |[_, _, user, kernel]| user + kernel)
}

/// Of a process, and of its children that it has waited for; none if it is gone.
pub(crate) fn of(pid: u32) -> Option<Duration> {
    times(&pid.to_string()).map(|times| times.iter().sum())
}

/// User's and kernel's time of a process, then of its ended children.
fn times(pid: &str) -> Option<[Duration; 4]> {
    read(&std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
}

fn read(stat: &str) -> Option<[Duration; 4]> {
    // The second field is the program's name in brackets, and may hold spaces and brackets; the four are the 14th to
    // 17th.
    let (_, rest) = stat.rsplit_once(')')?;
    let mut fields = rest.split_whitespace().skip(11).map(|field| field.parse::<u32>().ok().map(|ticks| TICK * ticks));
    Some([fields.next()??, fields.next()??, fields.next()??, fields.next()??])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn a_name_with_brackets_shifts_no_field() {
        let stat = "7 (a) b (c) S 1 7 7 0 -1 4194560 1 2 3 4 150 25 300 75 20 0 1 0 100\n";
        assert_eq!(read(stat), Some([1500, 250, 3000, 750].map(Duration::from_millis)));
        assert_eq!(read("7 (a) S 1"), None);
    }

    #[test]
    fn what_a_child_has_used_is_seen_once_it_has_ended() {
        let before = of_ended_children();
        // Some 100 ms of a shell; ten is asked for, the unit.
        let busy = "i=0; while [ $i -lt 100000 ]; do i=$((i + 1)); done";
        assert!(Command::new("sh").args(["-c", busy]).status().unwrap().success());
        assert!(of_ended_children() - before >= TICK);
        assert!(of(std::process::id()) >= Some(of_ended_children()) && of(u32::MAX).is_none());
    }
}
