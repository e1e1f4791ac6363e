//! Which stream a subcommand is about, and errors about it.

use crate::look::target::{Running, Target};
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::common::DataHead;
use rohrpost::description::noted;
use rohrpost::output::plain;
use rohrpost::schema::{DataItem, DataKind, Description};
use rohrpost_launch::survey::Scope;
use rohrpost_mailbox::{BODY_BYTES_MAX, StreamError, StreamId, StreamInfo};

#[derive(clap::Args)]
pub(super) struct StreamChoice {
    /// Module of the stream, such as camera.0.
    stream: String,
    /// The stream: its name, such as image, or its number; `rohrpost stream list` shows both.
    item: String,
    #[command(flatten)]
    target: Target,
}

/// A stream on a node that runs here. There may be none of this id.
pub(super) struct ChosenStream {
    pub(super) running: Running,
    pub(super) id: StreamId,
    /// What its module's description says of it; none without a description of this number.
    pub(super) item: Option<DataItem>,
}

/// The selected node, which must run on this computer.
fn node_here(target: &Target) -> Result<Running, Failure> {
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
pub(super) fn stream_failure(running: &Running, id: StreamId, text: &str, error: &StreamError) -> Failure {
    match error {
        StreamError::Owned { module, pid, .. } => {
            let writer = writer_text((*module != Name::NONE).then(|| running.text(*module)).as_deref(), Some(*pid));
            format!(
                "stream {text} is written by {writer}; a stream has one writer: stop that process, or use another \
                 number"
            )
            .into()
        }
        error => plain::line(&error.to_string().replace(&id.to_string(), text)).into(),
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
        let name = running.name(&self.stream)?;
        let (node, text) = (running.node_of(name), running.text(name));
        if node != running.node_name && !has_replica(&running, name) {
            return Err(format!(
                "{text} is a module of node {node}, and a stream lies in the memory of its node; use `--node {node}` \
                 on its computer"
            )
            .into());
        }
        let description = noted(&running.node, name);
        let (number, item) = find_item(&text, &self.item, description.as_ref())?;
        Ok(ChosenStream { id: StreamId { name, number }, item, running })
    }
}

/// Whether the node has a replica of a stream of this module.
fn has_replica(running: &Running, module: Name) -> bool {
    let of_it = running.installation.replicas.iter().filter(|replica| replica.from == module);
    of_it.flat_map(|replica| &replica.to).any(|to| *to == running.node_name)
}

/// The number of the stream that is named by its name or number, and what the description says of it.
fn find_item(stream: &str, text: &str, description: Option<&Description>) -> Result<(u16, Option<DataItem>), Failure> {
    let mut items = description.into_iter().flat_map(Description::streams);
    if let Ok(number) = text.parse() {
        return Ok((number, items.find(|item| item.number == number).cloned()));
    }
    if let Some(item) = items.find(|item| item.field.name == text) {
        return Ok((item.number, Some(item.clone())));
    }
    let Some(description) = description else {
        return Err(format!(
            "{stream} has left no description here, so what `{text}` is, is not known; name the stream by its number: \
             `rohrpost stream list` lists all"
        )
        .into());
    };
    let names: Vec<&str> = description.streams().map(|item| item.field.name.as_str()).collect();
    Err(match (description.data_item(text), &names[..]) {
        (Some(_), _) => {
            format!("`{text}` of {stream} is data and no stream; `rohrpost echo {stream} {text}` prints it")
        }
        (None, []) => {
            format!("{stream} describes no streams; name one by its number: `rohrpost stream list` lists all")
        }
        (None, _) => format!("{stream} has no stream `{text}`; it has: {}", names.join(", ")),
    }
    .into())
}

/// Why a command for data cannot have this: it is a stream with records that do not fit into a package, so another
/// command prints it. None where they fit, and where its node does not answer.
pub(crate) fn too_large_for_data(running: &Running, module: Name, item: &DataItem) -> Option<Failure> {
    if item.kind != DataKind::Stream {
        return None;
    }
    let node = running.node_of(module);
    let survey = running.look(node, Scope::Module(module.raw())).ok()?;
    let id = StreamId { name: module, number: item.number };
    let bytes = survey.streams.iter().find(|stream| stream.info.id == id)?.info.newest?.len_bytes;
    let bytes_max = BODY_BYTES_MAX - DataHead::BYTES;
    let (module, name) = (running.text(module), plain::line(&item.field.name));
    let place = if node == running.node_name { String::new() } else { format!(" on the computer of node {node}") };
    (bytes > bytes_max).then(|| {
        format!(
            "`{name}` of {module} is a stream with records of {bytes} B; at most {bytes_max} B travel as data. \
             `rohrpost stream read {module} {name}`{place} prints the newest record, with `--next 10` the next ones"
        )
        .into()
    })
}

/// What a module's description says of its stream.
pub(crate) fn item_of(running: &Running, id: StreamId) -> Option<DataItem> {
    noted(&running.node, id.name)?.streams().find(|item| item.number == id.number).cloned()
}

impl ChosenStream {
    /// As people type it, by its name where that is known.
    pub(super) fn text(&self) -> String {
        match &self.item {
            Some(item) => format!("{} {}", self.running.text(self.id.name), item.field.name),
            None => stream_text(&self.running, self.id),
        }
    }

    pub(super) fn failure(&self, error: &StreamError) -> Failure {
        stream_failure(&self.running, self.id, &self.text(), error)
    }

    /// The stream as it is now, if there is one.
    pub(super) fn look(&self) -> Result<Option<StreamInfo>, Failure> {
        self.running.node.inspect_stream(self.id).map_err(|error| self.failure(&error))
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::{DataKind, Field, Type};

    #[test]
    fn a_stream_is_named_by_its_name_or_its_number() {
        let item = |number, kind, name: &str| DataItem { number, kind, field: Field::new(name, Type::F64) };
        let (motion, image) = (item(1, DataKind::Data, "motion"), item(2, DataKind::Stream, "image"));
        let about = |data: &[&DataItem]| Description {
            name: "Camera".into(),
            class: "camera".into(),
            text: String::new(),
            functions: Vec::new(),
            data: data.iter().copied().cloned().collect(),
        };
        let camera = about(&[&motion, &image]);
        let find = |text, about| find_item("camera.0", text, about).map_err(|error| error.to_string());
        assert_eq!(find("image", Some(&camera)), Ok((2, Some(image.clone()))));
        assert_eq!(find("2", Some(&camera)), Ok((2, Some(image))));
        // Data of this number is none of the stream that somebody wrote by hand.
        assert_eq!((find("1", Some(&camera)), find("7", None)), (Ok((1, None)), Ok((7, None))));
        for (text, about, words) in [
            ("imege", Some(&camera), "camera.0 has no stream `imege`; it has: image"),
            ("motion", Some(&camera), "data and no stream; `rohrpost echo camera.0 motion` prints it"),
            ("image", Some(&about(&[&motion])), "describes no streams; name one by its number"),
            ("image", None, "camera.0 has left no description here"),
            ("70000", None, "camera.0 has left no description here"),
        ] {
            let told = find(text, about).unwrap_err();
            assert!(told.contains(words), "{text}: {told}");
        }
    }
}
