//! How tools look at nodes: at their own in its shared memory, at others by way of their launches. Nothing waits longer than
//! [`PATIENCE`]; a node that does not answer is silent, and that is told.

use super::Failure;
use super::summary::is_left_out;
use super::target::Running;
use rohrpost::ToolLink;
use rohrpost::config::Installation;
use rohrpost::description::Description;
use rohrpost::launch::{Look, launcher_of};
use rohrpost::mailbox::{InspectError, Name};
use rohrpost::survey::{LookFailure, MailboxLook, Scope, Seen, Survey, look_at_all};
use serde::Serialize;
use std::cell::RefCell;
use std::time::Duration;

/// Another node shows itself, or a module describes itself, within this time, or is silent.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);

/// A tool's place among those that call, taken when it first looks beyond its own node; given back with this.
#[derive(Default)]
pub(super) struct Sight(RefCell<Option<ToolLink>>);

impl Sight {
    fn with<T>(&self, running: &Running, ask: impl FnOnce(&mut ToolLink) -> T) -> Result<T, Failure> {
        let mut tool = self.0.borrow_mut();
        let link = match tool.take() {
            Some(link) => link,
            None => running.join(PATIENCE)?,
        };
        Ok(ask(tool.insert(link)))
    }
}

impl Drop for Sight {
    fn drop(&mut self) {
        if let Some(tool) = self.0.take() {
            tool.close();
        }
    }
}

/// A node that does not show itself.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Silence {
    pub(super) node: String,
    /// Why, in words.
    pub(super) why: String,
}

impl Silence {
    pub(super) fn text(&self) -> String {
        format!("node {} is silent: {}", self.node, self.why)
    }
}

impl Running {
    /// Looks at these nodes: at all of them at the same time. In their order: what each shows, or why it does not.
    pub(super) fn look_at(&self, nodes: &[&str], scope: Scope) -> Result<Vec<Result<Survey, Silence>>, Failure> {
        let others: Vec<&str> = nodes.iter().copied().filter(|node| *node != self.node_name).collect();
        let launchers: Vec<Name> = others.iter().filter_map(|node| launcher_of(&self.installation, node)).collect();
        let seen = match &launchers[..] {
            [] => Vec::new(),
            launchers => {
                self.sight.with(self, |tool| look_at_all(&mut tool.link, launchers, Look::Survey(scope), PATIENCE))?
            }
        };
        let mut seen = seen.into_iter();
        let look = |node: &&str| {
            if *node == self.node_name {
                let mut survey = Survey::within(scope, &self.node, &self.installation, node)?;
                survey.ask_kernel();
                return Ok(Ok(survey));
            }
            Ok(match seen.next() {
                Some(Ok(Seen::Survey(survey))) => Ok(*survey),
                Some(Err(failure)) => Err(silence(&self.installation, node, &failure)),
                Some(Ok(Seen::Mailbox(_))) | None => {
                    Err(Silence { node: (*node).into(), why: "it was not asked".into() })
                }
            })
        };
        nodes.iter().map(look).collect()
    }

    /// Looks at one node.
    pub(super) fn look(&self, node: &str, scope: Scope) -> Result<Survey, Failure> {
        match self.look_at(&[node], scope)?.pop() {
            Some(seen) => seen.map_err(|silence| silence.text().into()),
            None => Err(format!("no node `{node}`").into()),
        }
    }

    /// Looks at all nodes that are meant, and makes one survey of them; of those that are silent, the modules that they should have.
    pub(super) fn survey(&self, scope: Scope) -> Result<(Survey, Vec<Silence>), Failure> {
        let mut silent = Vec::new();
        let mut surveys = Vec::new();
        for seen in self.look_at(&self.shown(), scope)? {
            match seen {
                Ok(survey) => surveys.push(survey),
                Err(silence) => silent.push(silence),
            }
        }
        let names: Vec<&str> = silent.iter().map(|silence| silence.node.as_str()).collect();
        Ok((Survey::joined(surveys, &names, &self.installation), silent))
    }

    /// The modules of all nodes that are meant, but for those that need not run; with why, those that cannot be asked.
    pub(super) fn modules_to_ask(&self) -> Result<Vec<(Name, Option<Silence>)>, Failure> {
        let (survey, silent) = self.survey(Scope::Modules)?;
        let all = survey.modules.iter().filter(|module| !is_left_out(module, &self.installation));
        let why = |node: &str| silent.iter().find(|silence| silence.node == node).cloned();
        Ok(all.map(|module| (module.name, why(&module.node))).collect())
    }

    /// Looks at a mailbox, on whichever node it is; none when that has none of this name.
    pub(super) fn inspect(&self, name: Name) -> Result<Option<MailboxLook>, Failure> {
        let node = self.node_of(name);
        if node == self.node_name {
            return match MailboxLook::new(&self.node, name) {
                Ok(look) => Ok(Some(look)),
                Err(InspectError::Missing(_)) => Ok(None),
                Err(error @ InspectError::Bad(..)) => Err(self.told(name, &error)),
            };
        }
        let launchers: Vec<Name> = launcher_of(&self.installation, node).into_iter().collect();
        let what = Look::Mailbox(name.raw());
        let seen = self.sight.with(self, |tool| look_at_all(&mut tool.link, &launchers, what, PATIENCE))?.pop();
        match seen {
            Some(Ok(Seen::Mailbox(look))) => Ok(look.map(|look| *look)),
            Some(Err(failure)) => Err(silence(&self.installation, node, &failure).text().into()),
            Some(Ok(Seen::Survey(_))) | None => Err(format!("node {node} showed something else").into()),
        }
    }

    /// What a module offers: as it noted beside its mailboxes, so that it is not asked; on another node it has to be.
    pub(super) fn describe(&self, module: Name) -> Result<Description, Failure> {
        if self.is_own(module) {
            return Description::noted(&self.node, module).ok_or_else(|| self.absent(module));
        }
        let described = self.sight.with(self, |tool| tool.describe(module))?;
        described.map_err(|error| self.told(module, &error))
    }
}

/// Why a node does not show itself, without the number of its launch.
pub(super) fn silence(installation: &Installation, node: &str, failure: &LookFailure) -> Silence {
    let launch = launcher_of(installation, node).map(|name| name.to_string()).unwrap_or_default();
    Silence { node: node.into(), why: failure.to_string().replace(&launch, "its launch") }
}
