//! Mapping from class to the kernel's scheduling: the one place that maps class to SCHED_FIFO and nice.
//!
//! ```text
//!  class  1 ...... nice-below ........ real-time-from ............ 255
//!          nice 19 .. 1   |    nice 0        |   SCHED_FIFO 1 .. 60
//! ```
//!
//! FIFO 61 and above stay free for the timing threads of routers, which run above every module.

use crate::reader::Section;
use rohrpost_mailbox::Class;

/// Most urgent FIFO priority that a module gets; timing threads of routers lie above.
pub const FIFO_MAX: u8 = 60;

const REAL_TIME_FROM: u16 = 128;
const NICE_BELOW: u16 = 64;

/// How the processes of a class are scheduled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheduling {
    /// Real time: SCHED_FIFO.
    Fifo {
        /// 1..=[`FIFO_MAX`]; more is more urgent.
        priority: u8,
    },
    /// Not real time: the normal scheduler.
    Normal {
        /// 0..=19; more is less urgent.
        nice: i8,
    },
}

/// The section `[scheduling]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SchedulingRule {
    /// Classes from this id run in real time; 256 if none does.
    pub(crate) real_time_from: u16,
    /// Classes below this id give way to others.
    pub(crate) nice_below: u16,
}

impl Default for SchedulingRule {
    fn default() -> Self {
        Self { real_time_from: REAL_TIME_FROM, nice_below: NICE_BELOW }
    }
}

impl SchedulingRule {
    pub(crate) fn read(section: Option<Section<'_>>) -> Self {
        let Some(section) = section else { return Self::default() };
        let real_time_from = section.whole_or("real-time-from", 1..=256, REAL_TIME_FROM);
        let usual = NICE_BELOW.min(real_time_from);
        let nice_below = section.or("nice-below", usual, |item| item.whole(1..=256, NICE_BELOW));
        if let Some(item) = section.get("nice-below").filter(|_| nice_below > real_time_from) {
            item.report(format!(
                "`nice-below` {nice_below} is above `real-time-from` {real_time_from}, and a class cannot be both; \
                 write at most {real_time_from}"
            ));
        }
        section.finish();
        Self { real_time_from, nice_below }
    }

    /// Scheduling of a class. A higher class never gets less than a lower one.
    pub(crate) fn of(self, class: Class) -> Scheduling {
        let class = u16::from(class.0);
        if class >= self.real_time_from {
            let (step, steps) = (class - self.real_time_from, (255 - self.real_time_from).max(1));
            Scheduling::Fifo { priority: 1 + (step * u16::from(FIFO_MAX - 1) / steps) as u8 }
        } else {
            let below = self.nice_below.saturating_sub(class);
            Scheduling::Normal { nice: (19 * below).div_ceil(self.nice_below) as i8 }
        }
    }
}

impl std::fmt::Display for Scheduling {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fifo { priority } => f.pad(&format!("SCHED_FIFO {priority}")),
            Self::Normal { nice } => f.pad(&format!("nice {nice}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_map_as_documented() {
        let rule = SchedulingRule::default();
        for (class, scheduling) in [
            (255, Scheduling::Fifo { priority: 60 }),
            (200, Scheduling::Fifo { priority: 34 }),
            (128, Scheduling::Fifo { priority: 1 }),
            (127, Scheduling::Normal { nice: 0 }),
            (64, Scheduling::Normal { nice: 0 }),
            (63, Scheduling::Normal { nice: 1 }),
            (40, Scheduling::Normal { nice: 8 }),
            (16, Scheduling::Normal { nice: 15 }),
            (1, Scheduling::Normal { nice: 19 }),
        ] {
            assert_eq!(rule.of(Class(class)), scheduling, "class {class}");
        }
    }

    #[test]
    fn a_higher_class_never_gets_less_under_any_rule() {
        let rank = |scheduling| match scheduling {
            Scheduling::Fifo { priority } => i16::from(priority),
            Scheduling::Normal { nice } => -i16::from(nice),
        };
        for real_time_from in 1..=256 {
            for nice_below in 1..=real_time_from {
                let rule = SchedulingRule { real_time_from, nice_below };
                let ranks: Vec<i16> = (1..=255).map(|class| rank(rule.of(Class(class)))).collect();
                assert!(ranks.is_sorted() && ranks[0] >= -19 && ranks[254] <= 60, "{rule:?}");
            }
        }
    }
}
