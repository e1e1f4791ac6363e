//! A player tells its node the time: that of the log.

use rohrpost_config::{Installation, Program, TimeSource};
use rohrpost_mailbox::Name;
use rohrpost_modules::ModuleError;
use rohrpost_modules::runtime::{Context, TimeTeller};

/// Times of a log are after 1970 and before the year 2255, seconds: the rest is a mistake of its writer.
const STAMP_S_MIN: f64 = 1.0;
const STAMP_S_MAX: f64 = 9e9;

/// The writer of the node's time.
pub(super) struct Telling {
    /// Seconds of the log in a second.
    pace: f64,
    /// None before the log has begun.
    teller: Option<TimeTeller>,
}

impl Telling {
    /// Of the player that tells its node the time.
    pub(super) fn of(context: &Context, pace: f64) -> Option<Self> {
        tells_time(context.installation(), context.me()).then_some(Self { pace, teller: None })
    }

    /// Begins an epoch at the log's first stamp, ns since 1970; returns it.
    pub(super) fn begin(&mut self, context: &Context, stamp_s: f64) -> Result<u64, ModuleError> {
        let begin_ns = (stamp_s.clamp(STAMP_S_MIN, STAMP_S_MAX) * 1e9) as u64;
        self.teller.insert(context.tell_time()?).begin(begin_ns, self.pace, 0);
        Ok(begin_ns)
    }

    /// Lets time pass again, if it has begun.
    pub(super) fn goes_on(&mut self) -> bool {
        set_pace(&mut self.teller, self.pace)
    }

    /// Time stands still.
    pub(super) fn pause(&mut self) {
        set_pace(&mut self.teller, 0.0);
    }
}

/// False before time has begun.
fn set_pace(teller: &mut Option<TimeTeller>, pace: f64) -> bool {
    let Some(teller) = teller else { return false };
    if !teller.set_pace(pace) {
        tracing::error!(
            "time goes on at its old pace: this computer was too busy to change it; switch off and on again"
        );
    }
    true
}

/// Whether this module is the first player of its node, and the node's time is that of a log.
fn tells_time(installation: &Installation, me: Name) -> bool {
    let Some(node) = installation.node_of(me) else { return false };
    let plays = |program: &Program| matches!(program, Program::Builtin(name) if name == "carmen");
    let first = installation.modules_on(node).find(|module| plays(&module.program));
    installation.time == TimeSource::Log && first.is_some_and(|first| first.name == me)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const CONFIG: &str = r#"
installation = "one"
[system]
name = "robot"
id = 1
[classes]
player = { id = 170, text = "Plays" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[time]
source = "SOURCE"
[[module]]
name = "player.3"
builtin = "carmen"
settings = { file = "a.log" }
[[module]]
name = "player.1"
builtin = "carmen"
settings = { file = "a.log" }
"#;

    #[test]
    fn the_first_player_of_a_node_tells_the_time_if_that_is_a_logs() {
        for (source, expected) in [("log", [true, false]), ("local", [false; 2]), ("simulation", [false; 2])] {
            let text = CONFIG.replace("SOURCE", source);
            let installation = Installation::parse(&text, Path::new("robot.toml")).unwrap();
            let tells = [3, 1].map(|instance| tells_time(&installation, Name::new(1, 170, instance, 0)));
            assert_eq!(tells, expected, "{source}");
        }
    }
}
