//! Where system time comes from.

use crate::reader::Section;

/// The source of system time, section `[time]`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum TimeSource {
    /// The computer's own clock, or the master's where routers bear time.
    #[default]
    Local,
    /// The simulation; `speed` 2.0 lets time pass twice as fast.
    Simulation {
        /// Simulated seconds a second.
        speed: f64,
    },
    /// The records of a log that is being replayed.
    Log,
}

impl TimeSource {
    pub(crate) fn read(section: Option<Section<'_>>) -> Self {
        let Some(section) = section else { return Self::default() };
        let words = [("local", Self::Local), ("simulation", Self::Simulation { speed: 1.0 }), ("log", Self::Log)];
        let mut source = section.get("source").and_then(|item| item.choice(&words)).unwrap_or_default();
        if let Some(item) = section.get("speed") {
            match &mut source {
                Self::Simulation { speed } => *speed = item.number(0.01..=1000.0, "1.0").unwrap_or(1.0),
                Self::Local | Self::Log => {
                    item.report("`speed` goes only with `source = \"simulation\"`; drop it, or change the source");
                }
            }
        }
        section.finish();
        source
    }
}
