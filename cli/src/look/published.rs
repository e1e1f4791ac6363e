//! What a module publishes, by its own counters; its node may be launched again meanwhile.

use crate::look::target::{Running, Target};
use crate::measure::watch::{FlowFigures, Tracks};
use crate::terminal::{Failure, complain};
use rohrpost::Name;
use rohrpost::output::plain;
use rohrpost_launch::survey::{Scope, Survey};
use rohrpost_mailbox::{FlowInfo, Type};
use std::time::Duration;

/// Numbers and names of the selected data.
pub(crate) fn data_of(running: &Running, module: Name, name: Option<&str>) -> Result<Vec<(u16, String)>, Failure> {
    let text = running.text(module);
    let description = running.describe(module)?;
    let known: Vec<(u16, String)> = description.data.into_iter().map(|item| (item.number, item.field.name)).collect();
    let names = || known.iter().map(|(_, name)| plain::line(name)).collect::<Vec<_>>().join(", ");
    match name {
        _ if known.is_empty() => {
            let aliases = running.installation.module(module).map(|found| &found.aliases[..]).unwrap_or_default();
            let aliases: Vec<String> = aliases.iter().map(|alias| running.text(*alias)).collect();
            let aliases =
                if aliases.is_empty() { String::new() } else { format!("; its aliases may: {}", aliases.join(", ")) };
            Err(format!("{text} publishes no data{aliases}").into())
        }
        None => Ok(known),
        Some(name) => match known.iter().find(|(_, known)| known == name) {
            Some(one) => Ok(vec![one.clone()]),
            None => Err(format!("{text} has no data `{name}`; it has: {}", names()).into()),
        },
    }
}

/// A module that is observed repeatedly.
pub(crate) struct WatchedModule {
    pub(crate) running: Running,
    pub(crate) module: Name,
    /// The module as the user named it.
    text: String,
    pub(crate) tracks: Tracks,
    /// Whether a launch supervised the node at the last lookup.
    launched: bool,
    /// Whether the node was launched again, or answers again, so that the module's data must be looked up anew.
    changed: bool,
    /// Whether the module's node answered before and does not answer now.
    has_answered: bool,
    silent: bool,
}

impl WatchedModule {
    /// The module of this name, over a window of this length.
    pub(crate) fn new(target: &Target, text: &str, window: Duration) -> Result<Self, Failure> {
        let running = target.find()?;
        let module = running.module(text)?;
        if running.is_beyond(module) {
            return Err(format!(
                "{text} is beyond this system's nodes, and what it counts stands in its own node's memory; run this \
                 in system {}, or take `rohrpost echo {text}`, which subscribes",
                module.system()
            )
            .into());
        }
        let launched = running.node.launcher().is_some();
        Ok(Self {
            running,
            module,
            text: text.into(),
            tracks: Tracks::new(window),
            launched,
            changed: false,
            has_answered: false,
            silent: false,
        })
    }

    /// The module's name.
    pub(crate) fn name(&self) -> String {
        self.running.text(self.module)
    }

    /// The module's present state; none while its node is away, which is reported once.
    pub(crate) fn look(&mut self) -> Result<Option<Survey>, Failure> {
        let own = self.running.is_own(self.module);
        if own {
            self.find_again()?;
        }
        let node = self.running.node_of(self.module);
        match self.running.look(node, Scope::Module(self.module.raw())) {
            Ok(survey) => {
                if std::mem::take(&mut self.silent) {
                    complain(format_args!("node {node} answers again"));
                    self.changed = true;
                }
                self.has_answered = true;
                Ok(Some(survey))
            }
            // A node that has ended loses its directory; there is nothing to see until the next launch.
            Err(_) if own && !self.launched => Ok(None),
            Err(error) if own || !self.has_answered => Err(error),
            Err(error) => {
                if !std::mem::replace(&mut self.silent, true) {
                    complain(format_args!("{error}; waiting for it (Ctrl-C ends this)"));
                }
                Ok(None)
            }
        }
    }

    /// Observes once; an error if the module has no mailboxes.
    pub(crate) fn require_present(&mut self) -> Result<(), Failure> {
        let module = self.module;
        let has = |survey: Survey| survey.mailboxes.iter().any(|mailbox| mailbox.name.module() == module);
        if self.look()?.is_some_and(has) { Ok(()) } else { Err(self.running.absent(module)) }
    }

    /// If the node's launch has ended, looks for the node that replaces it; if there is one, earlier observations
    /// are dropped. Both events are reported apart from the figures.
    fn find_again(&mut self) -> Result<(), Failure> {
        if self.running.node.launcher().is_some() {
            self.launched = true;
            return Ok(());
        }
        let node = &self.running.node_name;
        if std::mem::take(&mut self.launched) {
            complain(format_args!(
                "launch of node `{node}` has ended; waiting until it is launched again (Ctrl-C ends this)"
            ));
        }
        let Some(running) = self.running.again().ok().filter(|again| again.node.launcher().is_some()) else {
            return Ok(());
        };
        complain(format_args!("node `{node}` was launched again"));
        self.module = running.module(&self.text)?;
        self.tracks = Tracks::new(self.tracks.window());
        (self.running, self.launched, self.changed) = (running, true, true);
        Ok(())
    }

    /// The selected data, as in [`data_of`]. They may differ after a new launch; until the module is there,
    /// `known` is used.
    pub(crate) fn renew(&mut self, known: &mut Vec<(u16, String)>, name: Option<&str>) {
        if self.changed
            && let Ok(found) = data_of(&self.running, self.module, name)
        {
            (*known, self.changed) = (found, false);
        }
    }

    /// Records what is published under the module's name.
    pub(crate) fn take_published(&mut self, survey: Survey) {
        let module = self.module;
        let is_own = |flow: &FlowInfo| flow.is_publication() && flow.from.module() == module;
        self.tracks.look(survey.at_ns, survey.flows.into_iter().filter(is_own));
    }

    /// Figures of the data with this number, if they were ever published.
    pub(crate) fn figures(&self, number: u16) -> Option<FlowFigures> {
        self.tracks.figures().find(|(flow, _)| flow.kind == Type::data(number)).map(|(_, figures)| figures)
    }
}
