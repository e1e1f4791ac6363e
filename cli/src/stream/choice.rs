//! Which stream a subcommand is about, and errors about it.

use crate::target::{Running, Target};
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::output::plain;
use rohrpost_mailbox::{StreamError, StreamId, StreamInfo};

#[derive(clap::Args)]
pub(super) struct StreamChoice {
    /// Module of the stream, such as camera.0.
    stream: String,
    /// Number of the stream, as `rohrpost stream list` shows it.
    number: u16,
    #[command(flatten)]
    target: Target,
}

/// A stream on a node that runs here. There may be none of this id.
pub(super) struct ChosenStream {
    pub(super) running: Running,
    pub(super) id: StreamId,
}

/// The selected node, which must run on this computer.
pub(super) fn node_here(target: &Target) -> Result<Running, Failure> {
    let running = target.find()?;
    let far = match running.shown()[..] {
        [only] if only != running.node_name => Some(only.to_owned()),
        _ => None,
    };
    match far {
        None => Ok(running),
        Some(far) => Err(format!(
            "node {far} does not run on this computer, and a stream lies in the memory of its node; use this command \
             there"
        )
        .into()),
    }
}

/// A stream as people type it.
pub(super) fn stream_text(running: &Running, id: StreamId) -> String {
    format!("{} {}", running.text(id.name), id.number)
}

/// An error about a stream, with its name as people type it.
pub(super) fn stream_failure(running: &Running, id: StreamId, error: &StreamError) -> Failure {
    let text = stream_text(running, id);
    match error {
        StreamError::Owned { module, pid, .. } => {
            let writer = writer_text((*module != Name::NONE).then(|| running.text(*module)).as_deref(), Some(*pid));
            format!(
                "stream {text} is written by {writer}; a stream has one writer: stop that process, or use another \
                 number"
            )
            .into()
        }
        error => plain::line(&error.to_string().replace(&id.to_string(), &text)).into(),
    }
}

/// A writer: its module, if it has a name, and its process.
pub(super) fn writer_text(module: Option<&str>, pid: Option<u32>) -> String {
    let process = pid.map_or("a process".into(), |pid| format!("process {pid}"));
    module.map_or(process.clone(), |module| format!("{module}, {process}"))
}

impl StreamChoice {
    pub(super) fn find(&self) -> Result<ChosenStream, Failure> {
        let running = node_here(&self.target)?;
        let name = running.installation.classes.parse_name(&self.stream)?;
        let node = running.node_of(name);
        if node != running.node_name {
            return Err(format!(
                "{} is a module of node {node}, and a stream lies in the memory of its node; use `--node {node}` on \
                 its computer",
                self.stream
            )
            .into());
        }
        Ok(ChosenStream { id: StreamId { name, number: self.number }, running })
    }
}

impl ChosenStream {
    pub(super) fn text(&self) -> String {
        stream_text(&self.running, self.id)
    }

    pub(super) fn failure(&self, error: &StreamError) -> Failure {
        stream_failure(&self.running, self.id, error)
    }

    /// The stream as it is now, if there is one.
    pub(super) fn look(&self) -> Result<Option<StreamInfo>, Failure> {
        self.running.node.inspect_stream(self.id).map_err(|error| self.failure(&error))
    }

    /// The stream as it is now.
    pub(super) fn inspect(&self) -> Result<StreamInfo, Failure> {
        self.look()?.ok_or_else(|| self.missing())
    }

    /// The error if there is no such stream, with those that there are.
    fn missing(&self) -> Failure {
        let (name, node) = (self.running.text(self.id.name), &self.running.node_name);
        let all = match self.running.node.streams() {
            Ok(all) => all,
            Err(error) => return error.into(),
        };
        let own: Vec<String> =
            all.iter().filter(|id| id.name == self.id.name).map(|id| id.number.to_string()).collect();
        if own.is_empty() {
            return format!("node {node} has no stream of {name}; `rohrpost stream list` lists all").into();
        }
        format!("{name} has no stream {}; it has {}", self.id.number, own.join(", ")).into()
    }
}

/// Modules with streams here, for completions.
pub(crate) fn completed_names(target: &Target) -> Vec<String> {
    let Ok(running) = target.find() else { return Vec::new() };
    let mut names: Vec<Name> = running.node.streams().unwrap_or_default().iter().map(|id| id.name).collect();
    names.dedup();
    names.into_iter().map(|name| running.text(name)).collect()
}

/// Numbers of the streams of the module that one of these words names, for completions.
pub(crate) fn completed_numbers(target: &Target, words: &[String]) -> Vec<String> {
    let Ok(running) = target.find() else { return Vec::new() };
    let named = words.iter().find_map(|word| running.installation.classes.parse_name(word).ok());
    let all = running.node.streams().unwrap_or_default();
    all.iter().filter(|id| Some(id.name) == named).map(|id| id.number.to_string()).collect()
}
