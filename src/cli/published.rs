//! What a module publishes, by its own counters, on a node that may be launched again meanwhile.

use super::Failure;
use super::target::{Running, Target};
use super::watch::{Figures, Tracks};
use rohrpost::Name;
use rohrpost::mailbox::{FlowInfo, Type};
use std::time::Duration;

/// Numbers and names of the data that are meant.
pub(super) fn data_of(running: &Running, module: Name, name: Option<&str>) -> Result<Vec<(u16, String)>, Failure> {
    let text = running.text(module);
    let description = running.noted(module)?;
    let known: Vec<(u16, String)> = description.data.into_iter().map(|item| (item.number, item.name)).collect();
    let names = || known.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ");
    match name {
        _ if known.is_empty() => {
            let faces = running.installation.module(module).map(|found| &found.faces[..]).unwrap_or_default();
            let faces: Vec<String> = faces.iter().map(|face| running.text(*face)).collect();
            let faces = if faces.is_empty() { String::new() } else { format!("; its faces may: {}", faces.join(", ")) };
            Err(format!("{text} publishes no data{faces}").into())
        }
        None => Ok(known),
        Some(name) => match known.iter().find(|(_, known)| known == name) {
            Some(one) => Ok(vec![one.clone()]),
            None => Err(format!("{text} has no data `{name}`; it has: {}", names()).into()),
        },
    }
}

/// A module that is looked at again and again.
pub(super) struct Watched {
    pub(super) running: Running,
    pub(super) module: Name,
    /// The module as the user named it.
    text: String,
    pub(super) tracks: Tracks,
    /// Whether a launch watched over the node when it was last looked for.
    launched: bool,
    /// Whether the node was launched again, and what the module publishes now is not known yet.
    changed: bool,
}

impl Watched {
    /// The module of this name, over so long a window.
    pub(super) fn new(target: &Target, text: &str, window: Duration) -> Result<Self, Failure> {
        let running = target.find()?;
        let module = running.module(text)?;
        let launched = running.node.launcher().is_some();
        Ok(Self { running, module, text: text.into(), tracks: Tracks::new(window), launched, changed: false })
    }

    /// If the node's launch has ended, looks for the node that was launched in its place; true when there is one, and what
    /// was seen before counts no more. Both are said where they do not stand among the figures.
    pub(super) fn find_again(&mut self) -> Result<bool, Failure> {
        if self.running.node.launcher().is_some() {
            self.launched = true;
            return Ok(false);
        }
        let node = &self.running.node_name;
        if std::mem::take(&mut self.launched) {
            eprintln!("launch of node `{node}` has ended; waiting until it is launched again (Ctrl-C ends this)");
        }
        let Some(running) = self.running.again().ok().filter(|again| again.node.launcher().is_some()) else {
            return Ok(false);
        };
        eprintln!("node `{node}` was launched again");
        self.module = running.module(&self.text)?;
        self.tracks = Tracks::new(self.tracks.window());
        (self.running, self.launched, self.changed) = (running, true, true);
        Ok(true)
    }

    /// Whether the node's launch has ended, and no other is there yet.
    pub(super) fn waits_for_launch(&self) -> bool {
        !self.launched
    }

    /// What is to be told of, as [`data_of`] has it. On a node that was launched again it may be something else; until the
    /// module is there, `known` is what it will be.
    pub(super) fn renew(&mut self, known: &mut Vec<(u16, String)>, name: Option<&str>) {
        if self.changed
            && let Ok(found) = data_of(&self.running, self.module, name)
        {
            (*known, self.changed) = (found, false);
        }
    }

    /// What is published under the module's name.
    pub(super) fn published(&self) -> impl Iterator<Item = FlowInfo> + use<> {
        let module = self.module;
        let flows = self.running.node.traffic().into_iter();
        flows.filter(move |flow| flow.is_publication() && flow.from.module() == module)
    }

    /// Figures of data of this number, if it was ever published.
    pub(super) fn figures(&self, number: u16) -> Option<Figures> {
        self.tracks.figures().find(|(flow, _)| flow.kind == Type::data(number)).map(|(_, figures)| figures)
    }
}
