//! Which running node a tool means.

use super::Failure;
use clap::Args;
use rohrpost::ToolLink;
use rohrpost::config::Installation;
use rohrpost::description::Description;
use rohrpost::mailbox::{Name, Node, SendError, node_directory};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Which node.
#[derive(Args)]
pub(super) struct Target {
    /// Configuration of the node; without it, the one node that runs.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Node of the configuration, if it has several.
    #[arg(long, value_name = "NAME", requires = "config")]
    node: Option<String>,
}

/// A node that runs, and its configuration.
pub(super) struct Running {
    pub(super) installation: Installation,
    pub(super) node_name: String,
    pub(super) node: Arc<Node>,
}

impl Target {
    pub(super) fn new(config: Option<PathBuf>, node: Option<String>) -> Self {
        Self { config, node }
    }

    /// Finds the node that is meant.
    pub(super) fn find(&self) -> Result<Running, Failure> {
        let (config, node_name) = match &self.config {
            Some(config) => (config.clone(), self.node.clone()),
            None => {
                let (config, node) = only_running()?;
                (config, Some(node))
            }
        };
        let installation = Installation::load(&config)?;
        let node_name = rohrpost::launch::choose_node(&installation, node_name.as_deref())?.name.clone();
        let node = Node::open(&node_directory(&installation.name, &node_name))?;
        Ok(Running { installation, node_name, node })
    }
}

/// Configuration and name of the one node that is launched now.
fn only_running() -> Result<(PathBuf, String), Failure> {
    let running = rohrpost::find_running();
    match &running[..] {
        [] => {
            // One that cannot be looked into is no reason to say that none is there.
            let others = rohrpost::find_other_versions().into_iter().next();
            Err(others.map_or_else(
                || "no node runs here; launch one: `rohrpost launch FILE`, or `rohrpost demo`".into(),
                Failure::from,
            ))
        }
        [only] => noted_config(only),
        several => {
            let list: Vec<String> = several.iter().map(|path| path.display().to_string()).collect();
            Err(format!("several nodes run here; say which with --config and --node:\n  {}", list.join("\n  ")).into())
        }
    }
}

/// What launch wrote about its configuration.
fn noted_config(directory: &Path) -> Result<(PathBuf, String), Failure> {
    let file = directory.join(rohrpost::launch::CONFIG_FILE);
    let text = std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
    match text.lines().collect::<Vec<_>>()[..] {
        [config, node] => Ok((config.into(), node.into())),
        _ => Err(format!("{} was written by another version of launch; say --config FILE", file.display()).into()),
    }
}

impl Running {
    /// The same node, launched anew: what it runs may have changed since.
    pub(super) fn again(&self) -> Result<Self, Failure> {
        let (config, node_name) = noted_config(self.node.path())?;
        let node = Node::open(self.node.path())?;
        Ok(Self { installation: Installation::load(&config)?, node_name, node })
    }

    /// Takes part as a tool.
    pub(super) fn join(&self, timeout: Duration) -> Result<ToolLink, Failure> {
        Ok(ToolLink::join(&self.installation, &self.node, &self.node_name, timeout)?)
    }

    /// The module or face that a user names, or a program run by hand: one of the configuration, or with mailboxes here.
    pub(super) fn module(&self, text: &str) -> Result<Name, Failure> {
        let classes = &self.installation.classes;
        let module = classes.parse_name(text)?.module();
        let known = self.installation.module(module).is_some() || module.class() == classes.tool();
        if known || self.is_here(module)? {
            return Ok(module);
        }
        let all: Vec<String> = self.installation.modules.iter().flat_map(|m| m.names()).map(|m| self.text(m)).collect();
        Err(format!("the configuration has no module `{text}`; there are {}", all.join(", ")).into())
    }

    /// The module or face that a user names, if it has mailboxes on this node.
    pub(super) fn present(&self, text: &str) -> Result<Name, Failure> {
        let module = self.module(text)?;
        if self.is_here(module)? { Ok(module) } else { Err(self.absent(module)) }
    }

    fn is_here(&self, module: Name) -> Result<bool, Failure> {
        Ok(self.node.mailboxes()?.iter().any(|mailbox| mailbox.module() == module))
    }

    /// A module that has no mailboxes here: why, and what to do.
    pub(super) fn absent(&self, module: Name) -> Failure {
        let name = self.text(module);
        match self.installation.module(module) {
            Some(known) if known.node != self.node_name => {
                format!(
                    "{name} is a module of node {}, and this is {}; no router leads there yet",
                    known.node, self.node_name
                )
            }
            Some(_) if self.node.launcher().is_some() => {
                format!("{name} does not run; `rohrpost start {name}` starts it, or says why it cannot")
            }
            Some(_) => {
                format!("{name} does not run, and no launch watches over it; start it as you started the others")
            }
            None => format!(
                "{name} does not run, and the configuration has no such module; `rohrpost list` shows what runs"
            ),
        }
        .into()
    }

    /// What the module offers, as it noted beside its mailboxes: nobody is asked.
    pub(super) fn noted(&self, module: Name) -> Result<Description, Failure> {
        Description::noted(&self.node, module).ok_or_else(|| self.absent(module))
    }

    /// An error about a module, with its name as users write it: the lower layers know numbers only.
    pub(super) fn told(&self, module: Name, error: &dyn std::error::Error) -> Failure {
        let text = error.to_string();
        if text.contains(&SendError::NoMailbox(module).to_string()) {
            return self.absent(module);
        }
        text.replace(&module.to_string(), &self.text(module)).into()
    }

    /// A name as users write it.
    pub(super) fn text(&self, name: Name) -> String {
        self.installation.classes.format(name)
    }
}
