//! From a command line or launch's environment to a running module.

use super::clock::ModuleClock;
use super::context::Context;
use super::endpoint::{Endpoint, Offered};
use super::environment;
use super::error::StartError;
use super::incarnation::Incarnation;
use super::own_end::{die_with_launch, end_with_lease, stop_on_signals};
use super::parameters;
use super::runner::Running;
use super::stream::{self, ServedStreams};
use crate::call::{Link, StandBy};
use crate::interface::{Served, StandIn};
use crate::journal::{Begin, ExactRun, JOURNAL_NUMBER, JournalEvent, JournalWriter, ModuleJournal};
use crate::made::MadeModule;
use crate::module::ModuleError;
use crate::output;
use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::Signal;
use rohrpost_config::{Installation, JOURNAL, MailboxSpec, Scheduling, Start as StartState};
use rohrpost_mailbox::{
    CreateError, ModuleState, Name, Node, NodeError, Participant, Shape, StreamError, StreamId, SystemClock, Work,
    base_directory, local, node_directory, sys,
};
use rohrpost_schema::Description;
use serde::de::DeserializeOwned;
use std::ffi::OsString;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Descriptors that launch keeps across restarts of this module, in launch's order. Call this once. Empty if launch
/// keeps none, or the module was started by hand.
pub fn kept() -> Vec<OwnedFd> {
    sys::handed_on()
}

/// How a module of a program is made: what it serves by types, what by descriptions, and what makes it of its settings.
pub(super) struct ModuleProgram<'a, M, S> {
    pub(super) served: Vec<Served<M>>,
    pub(super) stand_ins: MakeStandIns<'a, S>,
    pub(super) new: MakeModule<'a, M, S>,
}

type MakeStandIns<'a, S> = Box<dyn FnOnce(&S, &Installation) -> Result<Vec<StandIn>, ModuleError> + 'a>;
type MakeModule<'a, M, S> = Box<dyn FnOnce(S, &mut Context) -> Result<M, ModuleError> + 'a>;

/// What to start.
///
/// ```
/// use rohrpost_modules::runtime::{Start, StartError};
///
/// let start = Start::from_arguments(["--name", "pilot.0"].into_iter().map(String::from));
/// assert!(matches!(start, Err(StartError::Usage(_))), "which configuration?");
/// ```
#[derive(Debug)]
pub struct Start {
    /// The configuration.
    pub installation: Arc<Installation>,
    /// The module's name, local id 0.
    pub name: Name,
    /// Process id of the launch that started it, if one did.
    pub launcher: Option<u32>,
    /// Times that launch has started it again.
    pub restarts: u32,
    /// Leave it switched off.
    pub off: bool,
}

impl Start {
    /// Reads the command line and launch's environment.
    ///
    /// # Errors
    /// Usage, configuration, or an unknown module.
    pub fn from_environment() -> Result<Self, StartError> {
        Self::from_arguments(std::env::args_os().skip(1))
    }

    /// The same, with arguments that the caller has.
    ///
    /// # Errors
    /// As for [`Start::from_environment`].
    pub fn from_arguments(arguments: impl Iterator<Item: Into<OsString>>) -> Result<Self, StartError> {
        let variable = |name| std::env::var(name).ok();
        let (mut config, mut module) = (std::env::var_os(environment::CONFIG), std::env::var_os(environment::MODULE));
        let launcher = variable(environment::LAUNCHER).and_then(|pid| pid.parse().ok());
        let restarts = variable(environment::RESTARTS).and_then(|count| count.parse().ok()).unwrap_or(0);
        let mut off = std::env::var_os(environment::OFF).is_some();
        if let Some(run) = ExactRun::from_environment()? {
            // It ends with the tool that compares: nobody else waits for it.
            set_pdeathsig(Some(Signal::SIGKILL)).map_err(|error| StartError::System("prctl", error.into()))?;
            let (installation, name) = run.installation()?;
            return Ok(Self { installation: Arc::new(installation), name, launcher: None, restarts: 0, off: true });
        }
        let mut arguments = arguments.map(Into::<OsString>::into);
        while let Some(argument) = arguments.next() {
            let shown = argument.display();
            let mut value = || arguments.next().ok_or_else(|| StartError::Usage(format!("`{shown}` needs a value")));
            match argument.to_str() {
                Some("--config") => config = Some(value()?),
                Some("--name") => module = Some(value()?),
                Some("--off") => off = true,
                // Launch's own arguments of a program come after its environment; they are the module's business.
                _ if launcher.is_some() => {}
                _ => return Err(StartError::Usage(format!("unknown argument `{shown}`"))),
            }
        }
        let config = config.ok_or_else(|| StartError::Usage("which configuration?".into()))?;
        let module = module.ok_or_else(|| StartError::Usage("which module of it?".into()))?;
        let installation = Installation::load(Path::new(&config))?;
        let installation = match variable(environment::NODE) {
            Some(node) => installation.seen_from(&node),
            None => installation,
        };
        // A name that is no text is none of the configuration.
        let name = installation.classes.parse_module(&module.to_string_lossy())?;
        Ok(Self { installation: Arc::new(installation), name, launcher, restarts, off })
    }

    /// Joins the node, makes the mailboxes and the module.
    pub(super) fn join<M: MadeModule, S: DeserializeOwned>(
        self,
        program: ModuleProgram<'_, M, S>,
    ) -> Result<Running<M>, StartError> {
        let ModuleProgram { mut served, stand_ins, new } = program;
        let installation = self.installation.clone();
        let text = installation.classes.format(self.name);
        let module = installation.module(self.name).filter(|module| module.name == self.name);
        let module = module.ok_or_else(|| StartError::NoModule(installation.path.clone(), text.clone()))?;
        die_with_launch(self.launcher)?;
        let mode = installation.node(&module.node).map_or(0o700, |node| node.mode);
        let node = Node::create(&node_directory(&installation.name, &module.node), mode)?;
        let participant = Participant::join(&node, self.name)?;
        participant.set_state(ModuleState::Starting);
        participant.set_restarts(self.restarts);
        let stop = stop_on_signals(&participant, module.stop_within)?;
        let stands_by = stands_by(&participant, installation.lease_times().off, &stop)?;
        let clock = SystemClock::open(&node);
        let journal = self.journal(&participant, &clock)?;
        if !journal.is_replayed() {
            let quiet = std::env::var(environment::QUIET_MS).ok().filter(|_| self.launcher.is_some());
            let quiet = quiet.and_then(|ms| ms.parse().ok()).map_or(Duration::ZERO, Duration::from_millis);
            output::install_quiet(&participant, &installation, self.name, self.launcher.is_some(), quiet);
            schedule(installation.scheduling_of(module));
        }
        // The mailboxes themselves know numbers only.
        let receiver = |name: Name, spec: &MailboxSpec| {
            participant.clone().receiver(name, shape(spec)).map_err(|error: CreateError| {
                let text = error.to_string().replace(&name.to_string(), &installation.classes.format(name));
                StartError::Mailbox(text, error)
            })
        };
        let settings = installation.document().settings_as(module)?;
        let mut stand_ins = checked(stand_ins(&settings, &installation), &installation, module)?;
        let mut endpoints = Vec::new();
        for name in module.names() {
            let class = installation.classes.name(name.class()).unwrap_or_default().to_owned();
            let described = stand_ins.iter().position(|stand_in| stand_in.name == name);
            let typed = served.iter().position(|served| served.class == class);
            let offered = match (described, typed) {
                (Some(at), _) => Offered::Description(stand_ins.swap_remove(at).description),
                (None, Some(at)) => Offered::Types(served.swap_remove(at)),
                (None, None) if name == module.name => Offered::Nothing,
                (None, None) => return Err(StartError::Endpoint(installation.classes.format(name), text, class)),
            };
            let commands = receiver(name.with_local(local::COMMANDS), &module.mailboxes.commands)?;
            let named = installation.callers(name);
            endpoints.push(Endpoint::new(name, &class, commands, &named, offered));
        }
        if let Some(left) = served.iter().find(|served| !served.is_optional) {
            let names: Vec<String> =
                module.names().map(|name| format!("`{}`", installation.classes.format(name))).collect();
            return Err(StartError::Interface { module: text, names: names.join(", "), interface: left.class });
        }
        let data = receiver(self.name.with_local(local::DATA), &module.mailboxes.data)?;
        let replies = receiver(self.name.with_local(local::REPLIES), &module.mailboxes.replies)?;
        let mut link = Link::new(&participant, self.name, replies);
        let has_stood_by = stands_by.is_some();
        stands_by.into_iter().for_each(|stand_by| link.stand_by(stand_by));
        let clock = ModuleClock::new(clock, journal.clone());
        let names = endpoints.iter().map(|endpoint: &Endpoint<M>| endpoint.name).collect();
        let mut context = Context::new(self.name, installation.clone(), link, names, clock, data.shape());
        context.serves(&endpoints);
        let streams_of = |endpoint| {
            let Endpoint { name, offer, .. }: &Endpoint<M> = endpoint;
            ServedStreams { name: *name, items: &offer.streams, is_new: offer.is_new }
        };
        let served: Vec<_> = endpoints.iter().map(streams_of).collect();
        context.streams = stream::make(&participant, &installation, module, &served)?;
        journal.replay(|replay| {
            let own = endpoints.iter().map(|endpoint| Description::from_bytes(&endpoint.offer.description).ok());
            replay.know_own(own.collect());
        });
        journal.event(&JournalEvent::New, || context.clock.unseen().now().ns);
        participant.begin_work(Work::New);
        let made = new(settings, &mut context);
        participant.end_work();
        let mut made = made.map_err(|error| failed(&text, &error))?;
        parameters::check_start(&mut made, &installation, module, &text)?;
        output::drain();
        context.take_over().map_err(|error| StartError::Mailbox(error.to_string(), error))?;
        if has_stood_by {
            endpoints.iter_mut().for_each(|endpoint| endpoint.command_server.takes_over());
        }
        let turn_on = !self.off && module.start == StartState::On;
        let by_hand = self.launcher.is_none();
        let spin = module.spin;
        let life = Incarnation::new(made, participant, module.busy_after);
        Ok(Running { life, endpoints, data, context, stop, turn_on, by_hand, spin, sources: Vec::new() })
    }
}

impl Start {
    /// The journal that it repeats or writes, if either.
    fn journal(&self, participant: &Arc<Participant>, clock: &SystemClock) -> Result<ModuleJournal, StartError> {
        let installation = &*self.installation;
        let wanted = installation.record.as_ref().is_some_and(|record| record.is_exact(self.name));
        let journal = match ExactRun::from_environment()? {
            Some(run) => ModuleJournal::replayed(run.replay()?),
            None if wanted => {
                let id = StreamId { name: self.name, number: JOURNAL_NUMBER };
                let text = installation.classes.format(self.name);
                let failed = |error: StreamError| StartError::Stream(format!("the journal of `{text}`: {error}"));
                let stream = participant.stream_writer(id, JOURNAL.shape()).map_err(failed)?;
                ModuleJournal::written(JournalWriter::new(stream, clock.clone(), participant.node().next_incarnation()))
            }
            None => return Ok(ModuleJournal::default()),
        };
        let absolute = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned()).display().to_string();
        let module = installation.classes.format(self.name);
        let config = absolute(&installation.path);
        let saved = installation.saved.as_ref().map(|saved| (absolute(&saved.path), saved.text()));
        let saved = saved.as_ref().map(|(path, text)| (path.as_str(), *text));
        journal.begin(&Begin::new(&module, (&config, &installation.text), saved));
        Ok(journal)
    }
}

/// What it waits for before it has its mailboxes, if another node may run it, and this one does not.
fn stands_by(
    participant: &Arc<Participant>,
    off: Duration,
    stop: &Arc<AtomicBool>,
) -> Result<Option<StandBy>, StartError> {
    if std::env::var_os(environment::LEASE).is_none() {
        return Ok(None);
    }
    let holds = end_with_lease(participant, off)?;
    if holds.load(Ordering::Acquire) {
        return Ok(None);
    }
    participant.hide_mailboxes();
    Ok(Some(StandBy { holds, stop: stop.clone() }))
}

/// For what the module stands in: names of its own, each of the class that its description says.
fn checked(
    stand_ins: Result<Vec<StandIn>, ModuleError>,
    installation: &Installation,
    module: &rohrpost_config::Module,
) -> Result<Vec<StandIn>, StartError> {
    let text = |name| installation.classes.format(name);
    let stand_ins = stand_ins.map_err(|error| failed(&text(module.name), &error))?;
    for (at, StandIn { name, description }) in stand_ins.iter().enumerate() {
        let why = if !module.names().any(|own| own == *name) {
            "it does not have that name"
        } else if installation.classes.name(name.class()) != Some(description.class.as_str()) {
            "that name is of another class"
        } else if stand_ins[..at].iter().any(|earlier| earlier.name == *name) {
            "it does so twice"
        } else {
            continue;
        };
        let (module, class) = (text(module.name), description.class.clone());
        return Err(StartError::StandIn { module, name: text(*name), class, why });
    }
    Ok(stand_ins)
}

/// What a module says of itself while it is made.
fn failed(module: &str, error: &ModuleError) -> StartError {
    let (module, text) = (module.to_owned(), error.to_string());
    StartError::Module { module, text, errno: error.errno(), is_configuration: error.is_configuration() }
}

/// A mailbox's shape, as the configuration has it.
pub(crate) fn shape(spec: &MailboxSpec) -> Shape {
    Shape {
        slots: spec.slots,
        body_bytes_max: u16::try_from(spec.size).unwrap_or(u16::MAX),
        full: spec.full,
        max_age: spec.max_age,
        claims: spec.claims,
    }
}

/// Asks for the class's scheduling; a refusal is one warning.
fn schedule(wanted: Scheduling) {
    let how = match wanted {
        Scheduling::Fifo { priority } => sys::Scheduling::Fifo(priority),
        Scheduling::Normal { nice } => sys::Scheduling::Normal(nice),
    };
    if let Err(error) = sys::schedule(how) {
        if let sys::Scheduling::Fifo(_) = how {
            // Launch has started it before ordinary programs, perhaps.
            let _ = sys::schedule(sys::Scheduling::Normal(0));
        }
        tracing::warn!(
            errno = error.raw_os_error(),
            "runs without {wanted}: {error}; allow it with a limit `rtprio` for this user (limits.conf) or CAP_SYS_NICE"
        );
    } else if let sys::Scheduling::Fifo(_) = how {
        match sys::lock_memory() {
            Ok(true) => {}
            Ok(false) => tracing::debug!("memory is not locked: the memlock limit is finite (`ulimit -l`)"),
            Err(error) => tracing::warn!(errno = error.raw_os_error(), "memory is not locked: {error}"),
        }
    }
}

/// Directories of the nodes of this user that are launched now.
///
/// ```
/// for node in rohrpost_modules::runtime::find_running() {
///     println!("{}", node.display());
/// }
/// ```
pub fn find_running() -> Vec<PathBuf> {
    let launched = |node: &Node| node.launcher().is_some();
    nodes()
        .into_iter()
        .filter(|(_, node)| node.as_ref().is_ok_and(|node| launched(node)))
        .map(|(path, _)| path)
        .collect()
}

/// Why nodes cannot be looked into that are where this user's are: [`NodeError::Version`] of each that another version
/// of Rohrpost made, and [`NodeError::Foreign`] of each that another user made.
///
/// ```
/// for error in rohrpost_modules::runtime::find_unusable() {
///     eprintln!("{error}");
/// }
/// ```
pub fn find_unusable() -> Vec<NodeError> {
    let errors = nodes().into_iter().filter_map(|(_, node)| node.err());
    errors.filter(|error| matches!(error, NodeError::Version(..) | NodeError::Foreign(..))).collect()
}

/// All that is where nodes of this user are, by their directories.
fn nodes() -> Vec<(PathBuf, Result<Arc<Node>, NodeError>)> {
    let entries = std::fs::read_dir(base_directory()).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), Node::open(&path))).collect()
}
