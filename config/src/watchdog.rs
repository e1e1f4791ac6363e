//! How long a module may be silent before launch ends it.

use crate::calls::Calls;
use crate::reader::Section;
use crate::units::duration_text;
use std::fmt;
use std::time::Duration;

/// A busy computer holds each process up for milliseconds, and a mark tells its beginning to within two.
const LIMIT_MIN: Duration = Duration::from_millis(10);
/// A person notices a longer silence sooner.
const LIMIT_MAX: Duration = Duration::from_secs(600);
/// A module that hangs is not to go on for longer than this after that was noticed.
const GRACE_MAX: Duration = Duration::from_secs(60);

/// How long a module may be silent, and how it is ended then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watchdog {
    /// Longest silence: time of one turn of its code, of packages that wait and are not taken, of a stopped process.
    pub limit: Duration,
    /// Time between SIGTERM and SIGKILL.
    pub grace: Duration,
}

impl Watchdog {
    pub(crate) fn read(section: &Section<'_>, calls: &Calls) -> Option<Self> {
        let (watchdog, grace) = (section.get("watchdog"), section.get("watchdog-grace"));
        let Some(item) = watchdog else {
            let useless =
                "`watchdog-grace` is of no use without `watchdog`; write for example `watchdog = \"300 ms\"` too";
            grace.inspect(|item| item.report(useless));
            return None;
        };
        let grace = grace.map_or(Some(Duration::ZERO), |item| {
            let grace = item.duration("100 ms")?;
            let right = || format!("at most \"{}\": it hangs all that time", duration_text(GRACE_MAX));
            if grace <= GRACE_MAX { Some(grace) } else { item.wrong(&right()) }
        });
        let limit = item.duration("300 ms")?;
        if !(LIMIT_MIN..=LIMIT_MAX).contains(&limit) {
            let [least, most] = [LIMIT_MIN, LIMIT_MAX].map(duration_text);
            return item.wrong(&format!("\"{least}\" to \"{most}\", such as `watchdog = \"300 ms\"`"));
        }
        if let Some((to, longest)) = calls.longest.as_ref().filter(|(_, longest)| limit <= *longest) {
            let (longest, half) = (duration_text(*longest), duration_text(limit / 2));
            return item.wrong(&format!(
                "more than \"{longest}\", for which it may wait for an answer of `{to}`; or say in `calls` that it \
                 waits less, `{{ to = \"{to}\", within = \"{half}\" }}`, or with `subscribes = true` that it only \
                 subscribes"
            ));
        }
        Some(Self { limit, grace: grace? })
    }
}

impl fmt::Display for Watchdog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ended if silent for {}", duration_text(self.limit))?;
        match self.grace.is_zero() {
            true => Ok(()),
            false => write!(f, ", and killed after {} more", duration_text(self.grace)),
        }
    }
}
