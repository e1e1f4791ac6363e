//! What routers report of their slots, by `rohrpost net`, as for a user.

use super::stage::{NODES, Place};
use rohrpost_bench_local::harness::{Failure, OrFail, interrupted};
use serde::Deserialize;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// On a busy computer an answer may take longer than a tool waits.
const TRIES: usize = 5;

/// Data `slots` of a router, as far as it matters here. Counts only grow.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
pub struct Counts {
    /// Slots in which something was sent.
    pub used: u64,
    /// Slots in which nothing had to be sent.
    pub empty: u64,
    /// Slots omitted since the wake-up came too late.
    pub late: u64,
    /// Slots that passed without a wake-up.
    pub skipped: u64,
    /// Slots without packages since the time was too uncertain.
    pub silent: u64,
    /// `deadline`, `fifo` or `ordinary`.
    pub scheduled: String,
}

#[derive(Deserialize)]
struct StatusJson {
    slots: Option<Counts>,
    failure: Option<String>,
}

impl Counts {
    /// Of each node; asked on the node itself, so that nothing of it crosses the network.
    ///
    /// # Errors
    /// When a router does not answer, also not when it is asked again.
    pub fn ask(command: &Path, config: &Path, scratch: &Path) -> Result<Vec<Self>, Failure> {
        let mut answers = ask_all(command, config, scratch);
        for _ in 1..TRIES {
            if answers.is_ok() || interrupted() {
                break;
            }
            answers = ask_all(command, config, scratch);
        }
        answers
    }

    /// What has happened since `before`, on all nodes.
    pub fn between(before: &[Self], after: &[Self]) -> Self {
        let since = |figure: fn(&Self) -> u64| {
            before.iter().zip(after).map(|(before, after)| figure(after).saturating_sub(figure(before))).sum()
        };
        Self {
            used: since(|counts| counts.used),
            empty: since(|counts| counts.empty),
            late: since(|counts| counts.late),
            skipped: since(|counts| counts.skipped),
            silent: since(|counts| counts.silent),
            scheduled: after.first().map(|counts| counts.scheduled.clone()).unwrap_or_default(),
        }
    }

    /// Omitted slots, for whatever reason.
    pub fn omitted(&self) -> u64 {
        self.late + self.skipped + self.silent
    }

    /// The same, percent of all.
    pub fn omitted_percent(&self) -> f64 {
        self.omitted() as f64 * 100.0 / self.all().max(1) as f64
    }

    /// All slots.
    pub fn all(&self) -> u64 {
        self.used + self.empty + self.omitted()
    }
}

fn ask_all(command: &Path, config: &Path, scratch: &Path) -> Result<Vec<Counts>, Failure> {
    let ask = |node| {
        let mut asked = Command::new(command);
        asked.args(["net", "--json", "--node", &Place::Node(node).name(), "--config"]).arg(config);
        asked.env("ROHRPOST_DIR", scratch).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        asked.spawn().or_fail("rohrpost net")
    };
    // All at the same time.
    let asked = (0..NODES).map(ask).collect::<Result<Vec<_>, Failure>>()?;
    let answers: Vec<Result<Counts, Failure>> = asked.into_iter().map(answer).collect();
    answers.into_iter().collect()
}

fn answer(asked: Child) -> Result<Counts, Failure> {
    let output = asked.wait_with_output().or_fail("rohrpost net")?;
    let said = || format!("rohrpost net: {}", String::from_utf8_lossy(&output.stderr));
    // It fails if a peer is silent, which does not matter here.
    let told: Vec<StatusJson> = serde_json::from_slice(&output.stdout).or_fail(&said())?;
    let told = told.into_iter().next().ok_or_else(|| Failure::Failed(said()))?;
    told.slots.ok_or_else(|| Failure::Failed(told.failure.unwrap_or_else(said)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_routers_left_out_is_counted_over_all_nodes() {
        let counts = |used, late, skipped, silent| Counts { used, late, skipped, silent, ..Counts::default() };
        let before = [counts(10, 1, 0, 0), counts(20, 0, 0, 7)];
        let after = [counts(110, 3, 1, 0), counts(121, 0, 1, 9)];
        let since = Counts::between(&before, &after);
        assert_eq!((since.used, since.omitted(), since.all()), (201, 6, 207));
    }
}
