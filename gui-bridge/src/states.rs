//! What modules are doing, and what they say.

use crate::scene::{Scene, entity};
use rerun::{StateChange, StateConfiguration, TextDocument, TextLog, TextLogLevel};
use rohrpost::common::OutputLevel;
use rohrpost_launch::survey::Standing;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The states of a module, and their colours as 0xRRGGBBAA.
const COLOURS: [(Standing, u32); 10] = [
    (Standing::Starting, 0x5B8D_EFFF),
    (Standing::On, 0x3FA7_60FF),
    (Standing::Off, 0x6B74_80FF),
    (Standing::Error, 0xE6A0_1FFF),
    (Standing::Busy, 0xF2C1_4EFF),
    (Standing::Stopped, 0x8A8F_98FF),
    (Standing::StandsBy, 0x7C93_A8FF),
    (Standing::Failed, 0xD643_4EFF),
    (Standing::Restarting { attempt: 0, most: 0 }, 0xE57F_84FF),
    (Standing::Unreachable, 0xA97B_D6FF),
];

/// What is so far behind is not told late: time itself went back.
const STEPPED_BACK_NS: u64 = 10_000_000_000;
/// A line is cut after this many bytes.
const LINE_MAX: usize = 4096;

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Something does not work.
    Error,
    /// Something may stop working.
    Warning,
    /// Something that an operator wants to know.
    Info,
    /// Something that a programmer wants to know.
    Debug,
}

impl Level {
    fn name(self) -> &'static str {
        match self {
            Self::Error => TextLogLevel::ERROR,
            Self::Warning => TextLogLevel::WARN,
            Self::Info => TextLogLevel::INFO,
            Self::Debug => TextLogLevel::DEBUG,
        }
    }
}

impl From<OutputLevel> for Level {
    fn from(level: OutputLevel) -> Self {
        match level {
            OutputLevel::Error => Self::Error,
            OutputLevel::Warn => Self::Warning,
            OutputLevel::Info => Self::Info,
            OutputLevel::Debug | OutputLevel::Trace => Self::Debug,
        }
    }
}

/// The states of all modules as a table. A view of lanes shows only the time span that existed when it was opened; a
/// live view needs the table for the present.
fn table(states: &BTreeMap<String, String>) -> TextDocument {
    let mut table = String::from("| module | state |\n| --- | --- |\n");
    for (module, state) in states {
        let state = if state == "on" { state.clone() } else { format!("**{state}**") };
        // Writing to a String cannot fail.
        let _ = writeln!(table, "| {module} | {state} |");
    }
    TextDocument::from_markdown(table)
}

impl Scene {
    /// Sets the state of `module`. Repeating a state changes nothing, so each poll may call this. `text` says why, and
    /// becomes a line of output; leave it empty if there is nothing to say.
    pub fn module_state(&mut self, module: &str, state: Standing, text: &str) {
        let lane = entity(&["modules", module]);
        let told = state.to_string();
        match self.states.last.insert(module.into(), told.clone()) {
            Some(last) if last == told => {
                if self.states.table_is_old {
                    self.draw_states();
                }
                return;
            }
            Some(_) => {}
            None => self.log_static(lane.clone(), &colours()),
        }
        self.log(lane, &StateChange::single(state.word()));
        self.draw_states();
        if text.is_empty() {
            return;
        }
        let level = match state {
            Standing::Failed => Level::Error,
            Standing::Error | Standing::Busy | Standing::Restarting { .. } | Standing::Unreachable => Level::Warning,
            Standing::Starting | Standing::On | Standing::Off | Standing::Stopped | Standing::StandsBy => Level::Info,
        };
        self.output_line(module, level, text);
    }

    /// Gives something other than a module a lane: from now on it is in this state. Draws each change, however soon the
    /// next one comes.
    pub(crate) fn lane(&mut self, name: &str, state: Standing) {
        let lane = entity(&["modules", name]);
        if self.states.last.insert(name.into(), state.to_string()).is_none() {
            self.log_static(lane.clone(), &colours());
        }
        self.log_event(lane, &StateChange::single(state.word()));
        self.draw_states();
    }

    /// The table, unless a later one is drawn: then the next word of any module brings it.
    fn draw_states(&mut self) {
        let behind_ns = self.states.table_ns.saturating_sub(self.time_ns);
        self.states.table_is_old = (1..STEPPED_BACK_NS).contains(&behind_ns);
        if !self.states.table_is_old {
            self.states.table_ns = self.time_ns;
            let table = table(&self.states.last);
            self.log(entity(&["modules now"]), &table);
        }
    }

    /// `module` says something.
    pub fn output_line(&mut self, module: &str, level: Level, text: &str) {
        let line = TextLog::new(format!("{module}: {}", cut(text, LINE_MAX))).with_level(level.name());
        self.log_event(entity(&["output", module]), &line);
    }
}

fn colours() -> StateConfiguration {
    let (names, colours): (Vec<_>, Vec<_>) = COLOURS.into_iter().map(|(state, colour)| (state.word(), colour)).unzip();
    StateConfiguration::new().with_values(names).with_colors(colours)
}

/// The first `max` bytes of a text, less a character that this would tear.
pub(crate) fn cut(text: &str, max: usize) -> &str {
    &text[..text.floor_char_boundary(max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;

    #[test]
    fn a_state_said_again_draws_nothing() {
        let mut drawing = TestScene::new();
        let failed = (Standing::Failed, "was killed by signal 9");
        for (state, text) in [(Standing::Starting, ""), (Standing::On, ""), (Standing::On, "still on"), failed] {
            drawing.scene.module_state("laser.0", state, text);
        }
        let rows = drawing.rows();
        assert_eq!(rows["/modules/laser.0"], 3 + 1, "three changes and the colours");
        assert_eq!(rows[r"/modules\ now"], 3);
        assert_eq!(rows["/output/laser.0"], 1, "the reason of the last one");
    }

    /// A lane is coloured by the word, so each needs its colour.
    #[test]
    fn each_state_has_a_colour() {
        let mut words = COLOURS.map(|(state, _)| state.word());
        let mut all = Standing::WORDS;
        words.sort_unstable();
        all.sort_unstable();
        assert_eq!(words, all);
    }

    #[test]
    fn a_line_is_cut_between_characters() {
        assert_eq!(cut("äöü", 3), "ä");
        assert_eq!(cut("abc", 9), "abc");
    }
}
