//! What a thread did with its time, as the kernel tells: why it was late.

use crate::loss::LossCause;
use std::time::Instant;

/// What a thread did since it began, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Spent {
    /// The thread ran.
    ran: u64,
    /// The thread could have run, and others had the processor.
    waited: u64,
}

impl Spent {
    fn cause(self) -> LossCause {
        if self.waited > self.ran { LossCause::Processor } else { LossCause::Recorder }
    }

    /// The rest of this time it slept.
    fn cause_within(self, elapsed_ns: u64) -> LossCause {
        let awake = self.ran.saturating_add(self.waited);
        if awake < elapsed_ns / 2 { LossCause::Disk } else { self.cause() }
    }
}

/// Tells why a thread is late, by its time since a moment at which it was not.
#[derive(Clone, Debug)]
pub struct Pace {
    /// Where the kernel tells it.
    path: String,
    since: Instant,
    /// None if the kernel does not tell: then nobody is blamed for taking the processor.
    spent: Option<Spent>,
}

impl Pace {
    /// Of the thread that asks.
    pub fn of_this_thread() -> Self {
        // Where the link leads: others may ask for this thread, too.
        let link = std::fs::read_link("/proc/thread-self").unwrap_or_default();
        let path = format!("/proc/{}/schedstat", link.display());
        Self { since: Instant::now(), spent: read(&path), path }
    }

    /// The thread is not late now.
    pub fn begin(&mut self) {
        (self.since, self.spent) = (Instant::now(), read(&self.path));
    }

    /// Why a thread is late that sleeps when it has nothing to do: it worked, or others had the processor.
    pub fn cause(&self) -> LossCause {
        self.spent().map_or(LossCause::Recorder, Spent::cause)
    }

    /// Why a thread is late that always has something to do, so that it sleeps for the disk alone.
    pub(crate) fn cause_beside_disk(&self) -> LossCause {
        let elapsed_ns = u64::try_from(self.since.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.spent().map_or(LossCause::Disk, |spent| spent.cause_within(elapsed_ns))
    }

    fn spent(&self) -> Option<Spent> {
        let (before, now) = (self.spent?, read(&self.path)?);
        Some(Spent { ran: now.ran.saturating_sub(before.ran), waited: now.waited.saturating_sub(before.waited) })
    }
}

/// `RAN WAITED TIMES`.
fn read(path: &str) -> Option<Spent> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut numbers = text.split_whitespace().map(str::parse);
    let (ran, waited) = (numbers.next()?.ok()?, numbers.next()?.ok()?);
    Some(Spent { ran, waited })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn what_took_most_of_its_time_made_a_thread_late() {
        for (ran, waited, elapsed, cause, within) in [
            (40, 10, 60, LossCause::Recorder, LossCause::Recorder),
            (10, 40, 60, LossCause::Processor, LossCause::Processor),
            (10, 15, 60, LossCause::Processor, LossCause::Disk),
            (0, 0, 60, LossCause::Recorder, LossCause::Disk),
            (u64::MAX, u64::MAX, u64::MAX, LossCause::Recorder, LossCause::Recorder),
        ] {
            let spent = Spent { ran, waited };
            assert_eq!((spent.cause(), spent.cause_within(elapsed)), (cause, within), "{spent:?} of {elapsed}");
        }
    }

    #[test]
    fn the_kernel_tells_what_a_thread_did_also_to_others() {
        let mut pace = Pace::of_this_thread();
        pace.begin();
        let Some(before) = pace.spent.filter(|spent| *spent != Spent::default()) else {
            return println!("skipped: this kernel does not tell what threads wait for");
        };
        let awake = |spent: Spent| spent.ran + spent.waited;
        let asked = || std::thread::scope(|scope| scope.spawn(|| pace.spent().unwrap()).join().unwrap());
        let began = Instant::now();
        while awake(asked()) < 10_000_000 {
            assert!(began.elapsed() < Duration::from_secs(60), "{before:?}: {pace:?}");
        }
    }

    #[test]
    fn where_the_kernel_tells_nothing_nobody_is_blamed_for_taking_the_processor() {
        let mut pace = Pace { path: "/nowhere".into(), since: Instant::now(), spent: None };
        pace.begin();
        assert_eq!((pace.cause(), pace.cause_beside_disk()), (LossCause::Recorder, LossCause::Disk));
    }
}
