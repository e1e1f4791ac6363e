//! Which running node a tool uses, and the other nodes of its system.

use crate::look::observer::Tool;
use crate::terminal::Failure;
use crate::terminal::units::seconds;
use clap::Args;
use rohrpost::output::plain;
use rohrpost::{Fault, ToolLink};
use rohrpost_config::{HOLDERS_FILE, Installation};
use rohrpost_launch::choose_node;
use rohrpost_launch::launcher::launcher_of;
use rohrpost_launch::survey::{Scope, Standing, node_of};
use rohrpost_mailbox::{Name, Node, SendError, local};
use rohrpost_modules::runtime::{NotHere, NotedNode, configuration_here, open_here};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Selects a node. Without options, a tool takes the installation that runs here; if several of its nodes run here, the
/// first of the configuration. Its router reaches modules of the other nodes, so for most tools the choice makes no
/// difference.
#[derive(Args)]
pub(crate) struct Target {
    /// Configuration of the nodes; without it, the one that runs here.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Installation, by its name, where several run here.
    #[arg(long, short, value_name = "NAME", conflicts_with = "config")]
    installation: Option<String>,
    /// Use this node, and show it alone; default: the first of the configuration that runs here.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
}

/// How a tool asks modules for what they know: on which node, for how long, and how it prints that.
#[derive(Args)]
pub(crate) struct Inquiry {
    #[command(flatten)]
    pub(crate) target: Target,
    /// Timeout for an answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

impl Inquiry {
    /// Longest wait for an answer.
    pub(crate) fn timeout(&self) -> Result<Duration, Failure> {
        seconds(self.timeout)
    }
}

/// A running node and its configuration.
pub(crate) struct Running {
    pub(crate) installation: Installation,
    /// The node that the tool takes part on.
    pub(crate) node_name: String,
    pub(crate) node: Arc<Node>,
    /// The selected node; it may be another one, on another computer.
    only: Option<String>,
    /// Asks other nodes; it joins when it is first needed.
    pub(crate) observer: RefCell<Option<Tool>>,
}

impl Target {
    pub(crate) fn new(config: Option<PathBuf>, installation: Option<String>, node: Option<String>) -> Self {
        Self { config, installation, node }
    }

    /// The named configuration, if one is named.
    pub(crate) fn config(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    /// Configuration of the selected installation, which runs here.
    fn config_here(&self) -> Result<PathBuf, Failure> {
        configuration_here(self.installation.as_deref(), self.node.as_deref()).map_err(|error| match error {
            several @ NotHere::Several(_) => format!("{several}; say which with -i NAME, or with --config FILE").into(),
            error => error.into(),
        })
    }

    /// Finds the selected node.
    pub(crate) fn find(&self) -> Result<Running, Failure> {
        let only = self.node.as_deref();
        let installation = match &self.config {
            Some(config) => Installation::load(config)?,
            None => Installation::load(&self.config_here()?)?,
        };
        if only.is_some() {
            choose_node(&installation, only)?;
        }
        let (node_name, node) = open_here(&installation, only)?;
        let (node_name, only) = (node_name.to_owned(), self.node.clone());
        let installation = at_holders(installation, &node)?;
        Ok(Running { installation, node_name, node, only, observer: RefCell::default() })
    }
}

/// With each module of several nodes at the node that holds its lease, as the launch of this one knows.
fn at_holders(installation: Installation, node: &Node) -> Result<Installation, Failure> {
    let known = node.read_file(HOLDERS_FILE)?.unwrap_or_default();
    Ok(installation.at_holders(&String::from_utf8_lossy(&known)))
}

impl Running {
    /// The same node after a new launch: its configuration may have changed.
    pub(crate) fn again(&self) -> Result<Self, Failure> {
        let node = Node::open(self.node.path())?;
        let NotedNode { config, node: node_name } = NotedNode::of(&node)?;
        let (installation, only) = (at_holders(Installation::load(&config)?, &node)?, self.only.clone());
        Ok(Self { installation, node_name, node, only, observer: RefCell::default() })
    }

    /// With each module of several nodes at the selected one, if that is one of them: its launch is meant, whichever
    /// node holds the lease.
    pub(crate) fn at_selected(mut self) -> Self {
        if let Some(only) = &self.only {
            self.installation = self.installation.seen_from(only);
        }
        self
    }

    /// Takes part as a tool.
    pub(crate) fn join(&self, timeout: Duration) -> Result<Tool, Failure> {
        Ok(Tool::new(ToolLink::join(&self.installation, &self.node, &self.node_name, timeout)?))
    }

    /// The nodes to use when no module is named: the selected one, or all.
    pub(crate) fn shown(&self) -> Vec<&str> {
        let all = self.installation.nodes.iter().map(|node| node.name.as_str());
        all.filter(|name| self.only.as_deref().is_none_or(|only| only == *name)).collect()
    }

    /// A module's node. A module in no configuration can only be here.
    pub(crate) fn node_of(&self, module: Name) -> &str {
        node_of(&self.installation, module).unwrap_or(&self.node_name)
    }

    /// The launch that supervises a module.
    pub(crate) fn launcher_of(&self, module: Name) -> Option<Name> {
        launcher_of(&self.installation, self.node_of(module))
    }

    /// Whether it is on the node that the tool takes part on.
    pub(crate) fn is_own(&self, module: Name) -> bool {
        self.node_of(module) == self.node_name && !self.is_beyond(module)
    }

    /// Whether it is reached only through the TCP router: a module of another system, or a program of this system
    /// outside the configuration.
    pub(crate) fn is_beyond(&self, module: Name) -> bool {
        if module.system() != self.installation.system.id {
            return self.installation.reaches_others();
        }
        if self.installation.tcp.is_none() {
            return false;
        }
        !self.is_known(module) && !self.is_here(module)
    }

    /// Whether the configuration has it, or a range of tools that includes it.
    pub(crate) fn is_known(&self, module: Name) -> bool {
        self.installation.module(module).is_some() || module.class() == self.installation.classes.tool()
    }

    /// Whether it has mailboxes on the node that the tool takes part on.
    pub(crate) fn is_here(&self, module: Name) -> bool {
        self.node.mailboxes().is_ok_and(|all| all.iter().any(|mailbox| mailbox.module() == module))
    }

    /// The error for a module without mailboxes: why, and what to do.
    pub(crate) fn absent(&self, module: Name) -> Failure {
        let name = self.text(module);
        let known = self.installation.module(module);
        if let Some(why) = known.and_then(|known| self.not_ready(known.name)) {
            return format!("{name} {why}").into();
        }
        match known {
            Some(known) if known.node != self.node_name => {
                format!(
                    "{name} does not run on node {0}; `rohrpost start {name}` starts it, or says why it cannot",
                    known.node
                )
            }
            Some(_) if self.node.launcher().is_some() => {
                format!("{name} does not run; `rohrpost start {name}` starts it, or says why it cannot")
            }
            Some(_) => {
                format!("{name} does not run, and no launch supervises it; start it as you started the others")
            }
            None if self.is_beyond(module) && module.system() != self.installation.system.id => {
                format!("{name} does not run; start it in system {}, where it belongs", module.system())
            }
            None => format!(
                "{name} does not run, and the configuration has no such module; `rohrpost list` shows what runs"
            ),
        }
        .into()
    }

    /// How it stands with a module that is on its way, or came to nothing: what `rohrpost list` says of it.
    fn not_ready(&self, module: Name) -> Option<String> {
        let survey = self.look(self.node_of(module), Scope::Module(module.raw())).ok()?;
        let its = survey.module(module)?;
        let (standing, name) = (its.standing(), self.text(module));
        let error = || plain::line(&its.last_error(&self.installation)).into_owned();
        match standing {
            Standing::Starting => Some("is starting, and takes no commands yet".into()),
            Standing::Restarting { .. } => Some(format!("is {standing}, since it ended: {}", error())),
            Standing::Failed => Some(format!("has failed: {}; `rohrpost start {name}` tries it again", error())),
            Standing::On
            | Standing::Off
            | Standing::Error
            | Standing::Busy
            | Standing::Stopped
            | Standing::StandsBy
            | Standing::Unreachable => None,
        }
    }

    /// An error about a module, with its name as users write it: the lower layers know only numbers.
    pub(crate) fn told(&self, module: Name, error: &dyn std::error::Error) -> Failure {
        let text = error.to_string();
        // Detected by the sender, or by the router of the module's node.
        let absences = [SendError::NoMailbox(module).to_string(), Fault::NoMailbox.to_string()];
        if absences.iter().any(|absence| text.contains(absence)) {
            return self.absent(module);
        }
        if let Some(router) = self.missing_router(&text) {
            return router;
        }
        let text = match text.split_once("; ") {
            // The lower layers can only guess why.
            Some((late, _)) if late.starts_with(&format!("no answer from {module} within ")) => {
                self.standing_of_silent(module).map_or_else(|| text.clone(), |why| format!("{late}; {why}"))
            }
            _ => text,
        };
        plain::line(&text.replace(&module.to_string(), &self.text(module))).into()
    }

    /// An error about this node's own router; without it nothing reaches other nodes.
    fn missing_router(&self, text: &str) -> Option<Failure> {
        let router = self.installation.router_of(&self.node_name)?;
        let transit = router.with_local(local::TRANSIT).to_string();
        text.contains(&transit).then(|| {
            let (router, node) = (self.text(router), &self.node_name);
            format!(
                "the router of this node, {router}, does not run, and without it nothing goes from {node} to other \
                 nodes; `rohrpost start {router}` starts it, or says why it cannot"
            )
            .into()
        })
    }

    /// A name as users write it.
    pub(crate) fn text(&self, name: Name) -> String {
        self.installation.classes.format(name)
    }
}
