//! A tool's observer of other nodes: its place among the callers, and why a node does not answer.

use crate::terminal::units::short;
use rohrpost::output::plain;
use rohrpost::{CallError, Fault, ToolLink};
use rohrpost_builtin::format::iso;
use rohrpost_config::Installation;
use rohrpost_launch::launcher::launcher_of;
use rohrpost_launch::survey::LookFailure;
use rohrpost_mailbox::{SendError, realtime_ns};
use serde::Serialize;
use std::ops::{Deref, DerefMut};
use std::time::Duration;

/// Timeout for another node's report or a module's description.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);

/// A tool's place among the callers; released on drop.
pub(crate) struct Tool(Option<ToolLink>);

impl Tool {
    pub(crate) fn new(link: ToolLink) -> Self {
        Self(Some(link))
    }
}

impl Deref for Tool {
    type Target = ToolLink;

    fn deref(&self) -> &ToolLink {
        self.0.as_ref().expect("only drop takes it")
    }
}

impl DerefMut for Tool {
    fn deref_mut(&mut self) -> &mut ToolLink {
        self.0.as_mut().expect("only drop takes it")
    }
}

impl Drop for Tool {
    fn drop(&mut self) {
        if let Some(link) = self.0.take() {
            link.close();
        }
    }
}

/// A node that does not answer.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Silence {
    pub(crate) node: String,
    pub(crate) why: String,
    /// For how long, as far as it is known.
    pub(crate) silent_s: Option<f64>,
}

impl Silence {
    pub(crate) fn new(node: &str, why: impl Into<String>) -> Self {
        Self { node: node.into(), why: why.into(), silent_s: None }
    }

    /// Silent, and since when: a time of today, or a date.
    pub(crate) fn since(&self) -> String {
        self.silent_s.map_or("silent".into(), |silent_s| {
            let now_ns = realtime_ns();
            let since = iso(now_ns.saturating_sub((silent_s * 1e9) as u64));
            format!("silent since {} ({})", since.split('.').next().unwrap_or_default(), short(silent_s))
        })
    }

    pub(crate) fn text(&self) -> String {
        format!("node {} is {}: {}", self.node, self.since(), plain::line(&self.why))
    }
}

/// Why a node does not answer, without the number of its launch.
pub(crate) fn silence(installation: &Installation, node: &str, failure: &LookFailure) -> Silence {
    let launch = launcher_of(installation, node).map(|name| name.to_string()).unwrap_or_default();
    let why = match failure {
        // A router found it out.
        LookFailure::Call(CallError::Fault(_, Fault::NodeSilent { .. })) => {
            "no datagrams come from it; is it on, does its router run, and is its address reachable? (`rohrpost net`)"
                .into()
        }
        LookFailure::Call(CallError::Fault(_, Fault::NoMailbox)) => {
            "no launch runs there; is the node launched?".into()
        }
        LookFailure::Call(CallError::Fault(_, fault)) => fault.to_string(),
        LookFailure::Call(CallError::NotSent(SendError::NoMailbox(_) | SendError::NoRouter { .. })) => {
            "the router of this node does not run (`rohrpost list`)".into()
        }
        other => other.to_string().replace(&launch, "its launch"),
    };
    Silence::new(node, why)
}
