//! How tools observe nodes and their modules: their own node in its shared memory, others through their launches. No
//! call waits longer than [`PATIENCE`]; a node that does not answer is silent, and the tool reports that.

pub(crate) mod control;
pub(crate) mod observer;
pub(crate) mod published;
pub(crate) mod resolved;
pub(crate) mod summary;
pub(crate) mod target;

use crate::look::observer::{PATIENCE, Silence, silence};
use crate::look::summary::Account;
use crate::look::target::Running;
use crate::terminal::Failure;
use rohrpost::common::GET_DATA;
use rohrpost::description::noted;
use rohrpost::interface::DataPort;
use rohrpost::interfaces::{BeyondHost, BeyondHosts, BeyondState, LinkState, Links, RouterInterface, TcpInterface};
use rohrpost::output::plain;
use rohrpost::schema::Description;
use rohrpost::serde::de::DeserializeOwned;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, ToolLink};
use rohrpost_config::Installation;
use rohrpost_launch::launcher::{SnapshotRequest, launcher_of};
use rohrpost_launch::survey::{MailboxSnapshot, ModuleSurvey, Scope, Snapshot, Standing, Survey, look_at_all};
use rohrpost_mailbox::{InspectError, Name};
use std::collections::BTreeSet;

impl Running {
    /// Observes these nodes, all at the same time. Returns, in their order, what each reports, or why it does not
    /// answer.
    pub(crate) fn look_at(&self, nodes: &[&str], scope: Scope) -> Result<Vec<Result<Survey, Silence>>, Failure> {
        let others: Vec<&str> = nodes.iter().copied().filter(|node| *node != self.node_name).collect();
        let launchers: Vec<Name> = others.iter().filter_map(|node| launcher_of(&self.installation, node)).collect();
        let seen = match &launchers[..] {
            [] => Vec::new(),
            launchers => {
                self.ask(|tool| look_at_all(&mut tool.link, launchers, SnapshotRequest::Survey(scope), PATIENCE))?
            }
        };
        let mut seen = seen.into_iter();
        let look = |node: &&str| {
            if *node == self.node_name {
                let mut survey = Survey::within(scope, &self.node, &self.installation, node)?;
                survey.ask_kernel(&self.node);
                return Ok(Ok(survey));
            }
            Ok(match seen.next() {
                Some(Ok(Snapshot::Survey(survey))) => Ok(*survey),
                Some(Err(failure)) => Err(silence(&self.installation, node, &failure)),
                Some(Ok(Snapshot::Mailbox(_))) | None => Err(Silence::new(node, "it was not asked")),
            })
        };
        nodes.iter().map(look).collect()
    }

    pub(crate) fn look(&self, node: &str, scope: Scope) -> Result<Survey, Failure> {
        match self.look_at(&[node], scope)?.pop() {
            Some(seen) => seen.map_err(|silence| silence.text().into()),
            None => Err(format!("no node `{node}`").into()),
        }
    }

    /// Why nothing more comes of a module: it is in error, which only a command ends. None while it works, and where
    /// nobody knows.
    pub(crate) fn in_error(&self, module: Name) -> Option<Failure> {
        let survey = self.look(self.node_of(module), Scope::Module(module.raw())).ok()?;
        let found = survey.module(module).filter(|found| found.standing() == Standing::Error)?;
        let (name, why) = (self.text(found.name), found.last_error(&self.installation));
        let why = if why.is_empty() { format!("`rohrpost status {name}` says why") } else { why };
        Some(format!("{name} is in error, and nothing comes of it: {}", plain::line(&why)).into())
    }

    /// Observes all selected nodes, and merges them into one survey; for a silent node it lists the configured modules.
    pub(crate) fn survey(&self, scope: Scope) -> Result<(Survey, Vec<Silence>), Failure> {
        let (survey, mut silent) = self.joined(self.look_at(&self.shown(), scope)?);
        self.add_since(&mut silent);
        Ok((survey, silent))
    }

    /// Merges what nodes have reported, or why they do not answer.
    pub(crate) fn joined(&self, seen: impl IntoIterator<Item = Result<Survey, Silence>>) -> (Survey, Vec<Silence>) {
        let mut silent = Vec::new();
        let surveys = seen.into_iter().filter_map(|seen| seen.map_err(|silence| silent.push(silence)).ok()).collect();
        let names: Vec<&str> = silent.iter().map(|silence| silence.node.as_str()).collect();
        (Survey::joined(surveys, &names, &self.installation), silent)
    }

    /// Since when nodes are silent, if the own router knows it.
    fn add_since(&self, silent: &mut [Silence]) {
        if silent.is_empty() {
            return;
        }
        let Some(links) = self.links() else { return };
        for silence in silent {
            let link = links.peers.iter().find(|link| link.node == silence.node);
            let quiet = link.filter(|link| link.state != LinkState::Alive).and_then(|link| link.heard_ms);
            silence.silent_s = quiet.map(|heard_ms| heard_ms as f64 / 1e3);
        }
    }

    /// The own router's report of its links; none without a router that answers.
    fn links(&self) -> Option<Links> {
        let router = self.installation.router_of(&self.node_name)?;
        self.newest(router, RouterInterface::LINKS).ok()
    }

    fn newest<T: DeserializeOwned>(&self, module: Name, port: DataPort<T>) -> Result<T, Failure> {
        let told = self.ask(|tool| newest(tool, module, port))?;
        told.map(|(_, value)| value).map_err(|error| self.told(module, &error))
    }

    /// The names registered at the TCP router, or why they are not known; none without `[tcp]`.
    pub(crate) fn hosts_beyond(&self) -> Option<Result<BeyondHosts, Failure>> {
        if let Some(own) = self.installation.tcp_router() {
            return Some(self.newest(own, TcpInterface::HOSTS));
        }
        let elsewhere = self.installation.tcp_router_elsewhere()?;
        // A package to all systems gets no error when it is not delivered; only a timeout would show it.
        let told = self.takes_part().and_then(|()| self.newest(elsewhere, TcpInterface::HOSTS));
        Some(told.map_err(|error| format!("{error}; `rohrpost list` in the system that runs it shows them").into()))
    }

    /// Whether this is a mailbox for output lines. In any other module a mailbox of that local id has the module's own
    /// data.
    pub(crate) fn is_collector(&self, mailbox: Name) -> bool {
        let class = self.installation.classes.id(rohrpost::output::CLASS);
        class == Some(mailbox.class()) && mailbox.local() == rohrpost::output::LINES
    }

    /// Whether a host at the TCP router is none of this configuration, and no tool: tools come and go.
    pub(crate) fn is_outside(&self, host: &BeyondHost) -> bool {
        let name = Name::from_raw(host.first);
        name.class() != self.installation.classes.tool() && self.installation.module(name).is_none()
    }

    /// Modules at the TCP router that this configuration does not have; without whole ranges of names.
    pub(crate) fn modules_beyond(&self) -> Vec<Name> {
        let Some(Ok(hosts)) = self.hosts_beyond() else { return Vec::new() };
        let ends = |host: &BeyondHost| [host.first, host.last].map(|raw| Name::from_raw(raw).module());
        let names = hosts.hosts.iter().filter(|host| self.is_outside(host)).map(ends);
        names.filter(|[first, last]| first == last).map(|[name, _]| name).collect()
    }

    /// Whether the TCP router says that a client hosts this name.
    pub(crate) fn is_hosted_beyond(&self, module: Name) -> bool {
        let Some(Ok(hosts)) = self.hosts_beyond() else { return false };
        hosts.hosts.iter().any(|host| (host.first..=host.last).contains(&module.raw()))
    }

    /// Whether this node is connected to the TCP router, or why not.
    fn takes_part(&self) -> Result<(), Failure> {
        let Some(client) = self.installation.tcp_client_of(&self.node_name) else { return Ok(()) };
        let link = self.newest(client, TcpInterface::LINK)?;
        match link.state {
            BeyondState::Up => Ok(()),
            _ if link.why.is_empty() => Err(format!("node {} is not connected yet", link.node).into()),
            _ => Err(link.why.into()),
        }
    }

    /// The modules of all selected nodes, except optional ones; and those that cannot be asked, with the reason.
    pub(crate) fn modules_to_ask(&self) -> Result<Vec<(Name, Option<Silence>)>, Failure> {
        let (survey, silent) = self.survey(Scope::Modules)?;
        let is_asked =
            |module: &&ModuleSurvey| !module.is_left_out(&self.installation) && module.standing() != Standing::StandsBy;
        let all = survey.modules.iter().filter(is_asked);
        let why = |node: &str| silent.iter().find(|silence| silence.node == node).cloned();
        Ok(all.map(|module| (module.name, why(&module.node))).collect())
    }

    /// Observes a mailbox on any node; none if that node has no mailbox of this name.
    pub(crate) fn inspect(&self, name: Name) -> Result<Option<MailboxSnapshot>, Failure> {
        let node = self.node_of(name);
        if node == self.node_name {
            return match MailboxSnapshot::new(&self.node, name) {
                Ok(look) => Ok(Some(look)),
                Err(InspectError::Missing(_)) => Ok(None),
                Err(error @ InspectError::Bad(..)) => Err(self.told(name, &error)),
            };
        }
        let launchers: Vec<Name> = launcher_of(&self.installation, node).into_iter().collect();
        let what = SnapshotRequest::Mailbox(name.raw());
        let seen = self.ask(|tool| look_at_all(&mut tool.link, &launchers, what, PATIENCE))?.pop();
        match seen {
            Some(Ok(Snapshot::Mailbox(look))) => Ok(look.map(|look| *look)),
            Some(Err(failure)) => Err(silence(&self.installation, node, &failure).text().into()),
            Some(Ok(Snapshot::Survey(_))) | None => Err(format!("node {node} showed something else").into()),
        }
    }

    /// A module's interface: read from its description beside its mailboxes; on another node the module is asked.
    pub(crate) fn describe(&self, module: Name) -> Result<Description, Failure> {
        if self.is_own(module) {
            return noted(&self.node, module).ok_or_else(|| self.absent(module));
        }
        let described = self.ask(|tool| tool.describe(module))?;
        described.map_err(|error| self.told(module, &error))
    }

    /// The module, alias or manually started program that a user names: one of the configuration, with mailboxes here,
    /// of another system, or of this one and registered at the TCP router.
    pub(crate) fn module(&self, text: &str) -> Result<Name, Failure> {
        let module = self.name(text)?.module();
        let is_other = self.is_beyond(module) && module.system() != self.installation.system.id;
        if is_other || self.is_known(module) || self.is_here(module) || self.is_hosted_beyond(module) {
            return Ok(module);
        }
        Err(unknown_module(&self.installation, text))
    }

    /// The mailbox that a user names; a class alone is its one module.
    pub(crate) fn name(&self, text: &str) -> Result<Name, Failure> {
        parse_name(&self.installation, text, || self.node.mailboxes().unwrap_or_default())
    }

    /// What is known of a module that did not answer in time; none where nothing tells it from one that does.
    pub(crate) fn standing_of_silent(&self, module: Name) -> Option<String> {
        let survey = self.look(self.node_of(module), Scope::Module(module.raw())).ok()?;
        let Account { state, error, .. } = Account::of(survey.module(module)?, &self.installation);
        let is_told = matches!(state, Standing::Error) || !state.answers();
        is_told.then(|| error.map_or_else(|| format!("it is {state}"), |error| format!("it is {state}: {error}")))
    }

    /// Runs a query from the tool's place on its own node.
    fn ask<T>(&self, ask: impl FnOnce(&mut ToolLink) -> T) -> Result<T, Failure> {
        let mut place = self.observer.borrow_mut();
        let tool = match place.take() {
            Some(tool) => tool,
            None => self.join(PATIENCE)?,
        };
        Ok(ask(place.insert(tool)))
    }
}

/// The newest value of data that a module publishes, and when it did.
pub(crate) fn newest<T: DeserializeOwned>(
    tool: &mut ToolLink,
    module: Name,
    port: DataPort<T>,
) -> Result<(u64, T), CallError> {
    let write = |body: &mut Vec<u8>| append(body, &(port.number,));
    tool.call(module, GET_DATA, (port.hash)(), write, |bytes| from_bytes(bytes))
}

/// A name as users type it. A class alone is its one module, of the configuration or with mailboxes `here`.
pub(crate) fn parse_name(
    installation: &Installation,
    text: &str,
    here: impl FnOnce() -> Vec<Name>,
) -> Result<Name, Failure> {
    let classes = &installation.classes;
    let Some(class) = classes.id(text) else { return Ok(classes.parse_name(text)?) };
    let known = installation.modules.iter().flat_map(|module| module.names());
    let all = known
        .chain(here().into_iter().map(Name::module))
        .filter(|name| name.class() == class && name.system() == installation.system.id);
    let all: BTreeSet<Name> = all.collect();
    match *Vec::from_iter(&all) {
        [] => Err(format!("there is no module of class `{text}`; `rohrpost list` shows what runs").into()),
        [only] => Ok(*only),
        ref several => {
            let texts: Vec<String> = several.iter().map(|name| classes.format(**name)).collect();
            Err(format!("`{text}` may be {}; say which", texts.join(" or ")).into())
        }
    }
}

/// The error for a name that no module of a configuration has.
pub(crate) fn unknown_module(installation: &Installation, text: &str) -> Failure {
    let names = installation.modules.iter().flat_map(|module| module.names());
    let all: Vec<String> = names.map(|name| installation.classes.format(name)).collect();
    format!("the configuration has no module `{text}`; there are {}", all.join(", ")).into()
}
