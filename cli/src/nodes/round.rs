//! Polls the routers of all nodes one after the other, once or repeatedly: shared by `net` and `time`.

use crate::look::newest;
use crate::look::observer::{PATIENCE, Tool};
use crate::look::target::{Running, Target};
use crate::terminal::Failure;
use crate::terminal::units::{Stop, seconds};
use rohrpost::Name;
use rohrpost::interface::DataPort;
use rohrpost::serde::de::DeserializeOwned;
use rohrpost::{CallError, Fault};
use rohrpost_config::Installation;
use std::time::Duration;

/// Which nodes to ask, and how often.
#[derive(clap::Args)]
pub(crate) struct Rounds {
    #[command(flatten)]
    target: Target,
    /// Repeat the output.
    #[arg(long)]
    pub(crate) watch: bool,
    /// Time from one output to the next, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS", requires = "watch")]
    interval: f64,
    /// One JSON object a line.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Asks the routers.
pub(crate) struct Round {
    pub(crate) running: Running,
    pub(crate) interval: Duration,
    pub(crate) stop: Stop,
    pub(crate) tool: Tool,
}

impl Rounds {
    /// Finds the installation; if it has no router to ask, `alone` says what to look at instead.
    pub(crate) fn begin(&self, alone: impl Fn(&Installation) -> Option<String>) -> Result<Round, Failure> {
        let running = self.target.find()?;
        if let Some(instead) = alone(&running.installation) {
            return Err(instead.into());
        }
        let (interval, stop) = (seconds(self.interval)?, Stop::new()?);
        let tool = running.join(PATIENCE)?;
        Ok(Round { running, interval, stop, tool })
    }
}

impl Round {
    /// Names of the selected nodes.
    pub(crate) fn nodes(&self) -> Vec<String> {
        self.running.shown().into_iter().map(str::to_owned).collect()
    }

    /// The newest value that a node's router has published, with its time, or why there is none.
    pub(crate) fn newest<T: DeserializeOwned>(&mut self, node: &str, port: DataPort<T>) -> Result<(u64, T), String> {
        let router = self.running.installation.router_of(node).ok_or("it has no router")?;
        self.newest_of(router, port)
    }

    /// The same of any module.
    pub(crate) fn newest_of<T: DeserializeOwned>(
        &mut self,
        module: Name,
        port: DataPort<T>,
    ) -> Result<(u64, T), String> {
        newest(&mut self.tool, module, port).map_err(|error| match error {
            CallError::Fault(_, Fault::NothingYet) => "it has just started; ask again".into(),
            error => self.running.told(module, &error).to_string(),
        })
    }
}
