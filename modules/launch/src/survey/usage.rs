//! What a process takes of the computer, from /proc.

use std::time::Duration;

/// Ticks a second of the times in /proc/PID/stat: USER_HZ, 100 in the ABI of every architecture but alpha, whatever the
/// kernel's own tick is.
const TICKS_PER_S: u64 = 100;

/// What a process has taken so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Usage {
    /// Time that its threads ran, those that have ended included; in steps of 10 ms.
    pub cpu: Duration,
    /// The process's share of memory: what is resident of it alone, and its part of what several processes have,
    /// mailboxes above all. Where the kernel does not tell that, what is resident.
    pub memory_bytes: u64,
}

impl Usage {
    /// Usage of this process; none when it has ended.
    pub fn of(pid: u32) -> Option<Self> {
        let read = |file| std::fs::read_to_string(format!("/proc/{pid}/{file}")).ok();
        Some(Self { cpu: cpu(&read("stat")?)?, memory_bytes: memory(read)? })
    }
}

/// Fields 14 and 15, counted behind the name in brackets, which may hold anything.
fn cpu(stat: &str) -> Option<Duration> {
    let (_, rest) = stat.rsplit_once(") ")?;
    let mut fields = rest.split(' ').skip(11);
    let (user, system): (u64, u64) = (fields.next()?.parse().ok()?, fields.next()?.parse().ok()?);
    Some(Duration::from_millis((user + system) * (1000 / TICKS_PER_S)))
}

fn memory(read: impl Fn(&'static str) -> Option<String>) -> Option<u64> {
    // A page that is mapped more than once, or by several processes, is resident for each mapping.
    let share = read("smaps_rollup").and_then(|text| kilobytes(&text, "Pss:"));
    share.or_else(|| kilobytes(&read("status")?, "VmRSS:"))
}

/// A line of kB: `statm` says pages, and how large those are is not in /proc.
fn kilobytes(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_brackets_and_blanks_does_not_shift_the_fields() {
        let stat = "42 (a) 7 (b) S 1 42 42 0 -1 4194560 1 0 0 0 250 50 0 0 20 0 1 0 9 1000 300 18446744073709551615";
        assert_eq!(cpu(stat), Some(Duration::from_secs(3)));
        assert_eq!(cpu("42 (a) S 1"), None);
    }

    #[test]
    fn memory_is_told_in_bytes() {
        let status = "Name:\tx\nVmRSS:\t    2048 kB\nRssAnon:\t1 kB\n";
        let rollup = "5630-7ffc ---p 0 00:00 0 [rollup]\nRss:          999424 kB\nPss:             7168 \
            kB\nPss_Dirty:       12 kB\n";
        let of = |rollup: Option<&str>, status: &str| {
            memory(|file| if file == "status" { Some(status.into()) } else { rollup.map(str::to_owned) })
        };
        assert_eq!(of(Some(rollup), status), Some(7 << 20));
        assert_eq!(of(None, status), Some(2 << 20), "another user's process, or an old kernel");
        assert_eq!(of(Some(""), "Name:\tx\n"), None, "a zombie has none");
    }

    #[test]
    fn our_own_process_is_there_and_another_is_not() {
        let usage = Usage::of(std::process::id()).unwrap();
        assert!(usage.memory_bytes > 1 << 16, "{usage:?}");
        assert_eq!(Usage::of(0), None);
    }
}
