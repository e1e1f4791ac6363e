//! The installation that runs on this computer, as its launch noted it beside the mailboxes.

use super::start::{find_running, find_unusable};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, NodeError, node_directory};
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// File of a node's directory in which its launch notes the path of its configuration and the name of the node, a line
/// each.
pub const CONFIG_FILE: &str = "config";

/// Why no running installation was found.
#[derive(Debug, thiserror::Error)]
pub enum NotHere {
    /// Nothing runs.
    #[error("no node runs here; launch one: `rohrpost launch FILE`, or `rohrpost demo`")]
    Nothing,
    /// Others run.
    #[error("no installation `{0}` runs here; there are: {1}")]
    NoSuch(String, String),
    /// Several run, and none of them is named.
    #[error("several installations run here: {0}")]
    Several(String),
    /// The configuration has no node.
    #[error("the configuration has no node")]
    NoNode,
    /// A node cannot be looked into.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// Launch has left no note, or one of another version.
    #[error("{0}: its file `{CONFIG_FILE}` {1}; say --config FILE")]
    Note(PathBuf, &'static str),
}

/// What launch noted of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotedNode {
    /// The configuration's file.
    pub config: PathBuf,
    /// The node's name.
    pub node: String,
}

impl NotedNode {
    /// Reads launch's note of a node.
    ///
    /// # Errors
    /// [`NotHere::Note`] and [`NotHere::Node`].
    pub fn of(node: &Node) -> Result<Self, NotHere> {
        let told = |what| NotHere::Note(node.path().to_owned(), what);
        let bytes = node.read_file(CONFIG_FILE)?.ok_or_else(|| told("is not there"))?;
        match bytes.split(|byte| *byte == b'\n').collect::<Vec<_>>()[..] {
            [config, node, b""] => {
                let node = String::from_utf8_lossy(node).into_owned();
                Ok(Self { config: OsStr::from_bytes(config).into(), node })
            }
            _ => Err(told("was written by another version of launch")),
        }
    }

    /// The installation's name, by the node's directory.
    fn installation(&self, directory: &Path) -> String {
        let name = directory.file_name().unwrap_or_default().to_string_lossy();
        name.strip_suffix(&format!(".{}", self.node)).unwrap_or(&name).to_owned()
    }
}

/// Finds the configuration of the installation that runs here: the one of this name, or that has a node of this name,
/// or the only one.
///
/// ```
/// use rohrpost_modules::runtime::{NotHere, configuration_here};
/// match configuration_here(None, None) {
///     Ok(file) => println!("{}", file.display()),
///     Err(NotHere::Nothing) => println!("nothing runs"),
///     Err(error) => println!("{error}"),
/// }
/// ```
///
/// # Errors
/// See [`NotHere`].
pub fn configuration_here(installation: Option<&str>, node: Option<&str>) -> Result<PathBuf, NotHere> {
    let running = find_running();
    if running.is_empty() {
        // An unreadable node still exists, so the error must not say that there is none.
        return Err(find_unusable().into_iter().next().map_or(NotHere::Nothing, NotHere::Node));
    }
    let note = |path: PathBuf| {
        let noted = NotedNode::of(&*Node::open(&path)?)?;
        Ok((noted.installation(&path), noted))
    };
    let noted: Vec<(String, NotedNode)> = running.into_iter().map(note).collect::<Result<_, NotHere>>()?;
    let names = |noted: &[&(String, NotedNode)]| {
        let mut names: Vec<&str> = noted.iter().map(|(name, _)| name.as_str()).collect();
        names.dedup();
        names.join(", ")
    };
    let all: Vec<_> = noted.iter().collect();
    let mut meant: Vec<_> =
        all.iter().copied().filter(|(name, _)| installation.is_none_or(|wanted| wanted == name)).collect();
    if let (true, Some(wanted)) = (meant.is_empty(), installation) {
        return Err(NotHere::NoSuch(wanted.into(), names(&all)));
    }
    if meant.iter().any(|(_, noted)| node.is_some_and(|node| node == noted.node)) {
        // Else it may be a node of another computer.
        meant.retain(|(_, noted)| node.is_some_and(|node| node == noted.node));
    }
    let mut configs: Vec<&PathBuf> = meant.iter().map(|(_, noted)| &noted.config).collect();
    configs.sort_unstable();
    configs.dedup();
    match configs[..] {
        [only] => Ok(only.clone()),
        _ => Err(NotHere::Several(names(&meant))),
    }
}

/// Opens a node of an installation that runs here: the one of this name, or else the first that does. Returns its name,
/// too.
///
/// # Errors
/// [`NotHere::Node`], of the first that should run here.
pub fn open_here<'i>(installation: &'i Installation, named: Option<&str>) -> Result<(&'i str, Arc<Node>), NotHere> {
    let named = installation.nodes.iter().filter(|node| named == Some(&node.name));
    let mut failed = None;
    for config in named.chain(&installation.nodes) {
        match Node::open(&node_directory(&installation.name, &config.name)) {
            Ok(node) => return Ok((&config.name, node)),
            Err(error @ NodeError::Missing(_)) => failed = failed.or(Some(error)),
            Err(error) => return Err(error.into()),
        }
    }
    Err(failed.map_or(NotHere::NoNode, NotHere::Node))
}
