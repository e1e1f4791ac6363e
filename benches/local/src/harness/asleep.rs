//! Whether processes sleep between messages, as a case says of them. Woken, they take some ten times as long as awake:
//! a turn with some of both would say how many of each there were, and nothing else.

use super::{Failure, OrFail};
use std::fs;

/// One of so many messages may have found its receiver awake, and one more: the first or the last.
const ONE_IN: u64 = 100;

/// Times that the main thread of a process has given its processor away so far: to sleep, or to another thread.
///
/// # Errors
/// When the process is gone.
pub fn given_away(pid: i32) -> Result<u64, Failure> {
    let status =
        fs::read_to_string(format!("/proc/{pid}/status")).or_fail("how often a process gave its processor away")?;
    let counts = status.lines().filter_map(|line| line.split_once("voluntary_ctxt_switches:"));
    Ok(counts.filter_map(|(_, count)| count.trim().parse::<u64>().ok()).sum())
}

/// Whether a process that had so many messages has given its processor away before each of them, or nearly.
///
/// # Errors
/// [`Failure::Skipped`] when it has not: then it was awake, and its times are those of something else.
pub fn require_asleep(what: &str, messages: u64, given_away: u64) -> Result<(), Failure> {
    if given_away >= messages.saturating_sub(1 + messages / ONE_IN) {
        return Ok(());
    }
    Err(Failure::Skipped(format!(
        "{what} slept before {given_away} of {messages} messages only, so the times are not those of one that sleeps; \
         measure on an idle computer that grants real time"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_that_was_awake_is_told() {
        assert_eq!(require_asleep("the module", 1000, 989), Ok(()));
        let told = require_asleep("the module", 1000, 988).unwrap_err();
        assert!(told.to_string().starts_with("skipped: the module slept before 988 of 1000 messages only"), "{told}");
    }

    #[test]
    fn a_sleep_is_counted() {
        // Of the main thread, whatever thread this is.
        let process = std::process::Command::new("sleep").arg("60").spawn();
        let mut process = process.unwrap();
        let pid = process.id() as i32;
        while given_away(pid).unwrap() == 0 {
            std::thread::yield_now();
        }
        process.kill().unwrap();
        process.wait().unwrap();
        assert!(given_away(pid).is_err());
    }
}
