//! What a module can ask of its runtime.

mod opened;
mod publishing;
mod sending;
mod standing_in;
mod streaming;
mod subscribing;
mod taking_in;
mod timing;
mod watching;

pub(super) use publishing::Distribution;

use super::clock::ModuleClock;
use super::endpoint::Endpoint;
use super::error::ContextError;
use super::follow::Followings;
use super::newest::Newest;
use super::refusals::Refusals;
use super::running_command::RunningCommand;
use super::schedule::Schedule;
use super::stream::{FollowedStreams, OwnStreams};
use super::time_teller::TimeTeller;
use crate::call::{Caller, Link};
use crate::interface::Proxy;
use crate::journal::ModuleJournal;
use crate::publish::Subscriptions;
use opened::OpenedFile;
use rohrpost_config::{Installation, Principal, TimeSource};
use rohrpost_mailbox::{CreateError, Name, OverflowPolicy, Publications, Receiver, Shape, SystemTime, Watches, local};
use std::path::PathBuf;
use std::sync::Arc;

/// What a module wants of another one.
#[derive(Clone, Copy, PartialEq)]
enum Wish {
    Call,
    Subscribe,
}

/// A module's connection to its node: proxies, subscriptions, publishing, time, settings.
///
/// ```
/// use rohrpost_modules::interfaces::WheelsInterface;
/// use rohrpost_modules::runtime::{Context, ContextError, Rate, Subscription};
/// use rohrpost_modules::types::Odometry;
///
/// fn prepare(context: &mut Context) -> Result<Subscription<Odometry>, ContextError> {
///     context.set_period(std::time::Duration::from_millis(100));
///     context.subscribe(WheelsInterface::ODOMETRY.data(), "odometry.0", Rate::Each)
/// }
/// ```
pub struct Context {
    pub(crate) me: Name,
    pub(crate) installation: Arc<Installation>,
    pub(crate) link: Caller,
    pub(crate) endpoints: Vec<Name>,
    /// For each endpoint the hash of the interface that the module serves there, if it serves one.
    served: Vec<Option<u32>>,
    /// For each endpoint numbers and names of the data that it has without types, if it stands in for another module.
    stood_in: Vec<Option<Vec<(u16, String)>>>,
    /// Numbers and names of the functions of all of them.
    pub(crate) functions: Vec<(u16, String)>,
    pub(crate) newest: Vec<Newest>,
    /// Streams that the module writes.
    pub(super) streams: OwnStreams,
    /// Streams of which it is given each record.
    pub(super) followed_streams: FollowedStreams,
    /// Counts what is published.
    publications: Publications,
    pub(crate) subscriptions: Subscriptions,
    pub(crate) followings: Followings,
    pub(crate) refusals: Refusals,
    pub(crate) clock: ModuleClock,
    /// What the module is told, and what it says.
    pub(crate) journal: ModuleJournal,
    /// Mailboxes of the module's own, besides commands, replies and data.
    pub(crate) own: Vec<Receiver>,
    /// Mailboxes that take subscribed data, by local id, and whether only the newest counts there.
    taking: Vec<(u8, bool)>,
    /// Mailboxes that take data from all.
    open: Vec<u8>,
    /// Descriptors that the module waits for; none as long as it never asked.
    pub(crate) watches: Option<Watches>,
    /// Descriptors of `open_outside`, if there is a journal.
    outside: Vec<OpenedFile>,
    /// Nothing that came is left behind at its end.
    pub(super) takes_all_at_end: bool,
    /// When ticks and periods are due.
    pub(crate) schedule: Schedule,
    /// The command of the module's own that is being run.
    pub(super) running_command: RunningCommand,
    /// What does not work, as the module itself says; empty: all does.
    pub(super) complaint: String,
    scratch: Vec<u8>,
}

impl Context {
    pub(crate) fn new(
        me: Name,
        installation: Arc<Installation>,
        link: Link,
        endpoints: Vec<Name>,
        clock: ModuleClock,
        data: &Shape,
    ) -> Self {
        let journal = clock.journal().clone();
        let publications = Publications::new(link.participant());
        let followings = Followings::of(link.incarnation(), installation.clone());
        let named: Vec<Principal> = endpoints.iter().flat_map(|endpoint| installation.callers(*endpoint)).collect();
        let subscriptions = Subscriptions::new(&named);
        let schedule = Schedule::new(&installation, clock.unseen());
        let running_command = RunningCommand::new(journal.clone());
        let limits = installation.module(me).map(|module| module.call_limits.clone()).unwrap_or_default();
        Self {
            me,
            installation,
            link: Caller::new(link, journal.clone(), limits),
            endpoints,
            served: Vec::new(),
            stood_in: Vec::new(),
            functions: Vec::new(),
            newest: Vec::new(),
            streams: Vec::new(),
            followed_streams: FollowedStreams::default(),
            publications,
            subscriptions,
            followings,
            refusals: Refusals::default(),
            clock,
            journal,
            own: Vec::new(),
            taking: vec![(local::DATA, data.full == OverflowPolicy::Latest)],
            open: Vec::new(),
            watches: None,
            outside: Vec::new(),
            takes_all_at_end: false,
            schedule,
            running_command,
            complaint: String::new(),
            scratch: Vec::new(),
        }
    }

    /// Stands by, if another node runs the module.
    pub(super) fn take_over(&mut self) -> Result<(), CreateError> {
        let mut link = self.link.unseen().borrow_mut();
        link.take_over()?;
        self.followings.begin(link.incarnation());
        Ok(())
    }

    /// Under its names the module serves these interfaces.
    pub(super) fn serves<M>(&mut self, endpoints: &[Endpoint<M>]) {
        self.served = endpoints.iter().map(|endpoint| endpoint.offer.serve.map(|_| endpoint.offer.hash)).collect();
        self.stood_in = endpoints.iter().map(|endpoint| endpoint.offer.stands_in.clone()).collect();
        self.functions = endpoints.iter().flat_map(|endpoint| endpoint.offer.functions.iter().cloned()).collect();
    }

    /// The module's own name.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn own_node(context: &Context) -> Option<&str> {
    ///     context.installation().module(context.me()).map(|module| module.node.as_str())
    /// }
    /// ```
    pub fn me(&self) -> Name {
        self.me
    }

    /// The configuration that it runs under.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn title(context: &Context) -> String {
    ///     format!("{} of {}", context.installation().classes.format(context.me()), context.installation().name)
    /// }
    /// ```
    pub fn installation(&self) -> &Installation {
        &self.installation
    }

    /// Resolves a path of the settings, relative to the configuration file's folder. What is in a file there belongs to
    /// the settings: an exact replay wants the same.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn map(context: &Context) -> std::io::Result<Vec<u8>> {
    ///     std::fs::read(context.path("maps/office.bin"))
    /// }
    /// ```
    pub fn path(&self, named: &str) -> PathBuf {
        let path = self.installation.resolve(named);
        self.journal.file(named, &path);
        path
    }

    /// System time now, with its error bound and age; its field `ns` is ns since 1970.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn age_s(context: &Context, stamp_ns: u64) -> f64 {
    ///     context.now().ns.saturating_sub(stamp_ns) as f64 / 1e9
    /// }
    /// ```
    pub fn now(&self) -> SystemTime {
        self.clock.now()
    }

    /// The clock that system time is read from, to keep.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn stamp_in_a_thread(context: &Context) -> std::thread::JoinHandle<u64> {
    ///     let clock = context.clock().clone();
    ///     std::thread::spawn(move || clock.now().ns)
    /// }
    /// ```
    pub fn clock(&self) -> &ModuleClock {
        &self.clock
    }

    /// Becomes the writer of the node's time, which is a log's (`source = "log"`): for a module that plays one. There
    /// is to be one writer on a node. Until it begins, the node has no time.
    ///
    /// ```
    /// # use rohrpost_modules::{ModuleError, runtime::{Context, TimeTeller}};
    /// fn begin(context: &Context, first_stamp_ns: u64) -> Result<TimeTeller, ModuleError> {
    ///     let mut time = context.tell_time()?;
    ///     time.begin(first_stamp_ns, 1.0, 0);
    ///     Ok(time)
    /// }
    /// ```
    ///
    /// # Errors
    /// [`ContextError::OtherTime`] where the time is another one, [`ContextError::Node`] when its page cannot be
    /// opened.
    pub fn tell_time(&self) -> Result<TimeTeller, ContextError> {
        if self.installation.time != TimeSource::Log {
            return Err(ContextError::OtherTime);
        }
        Ok(TimeTeller::of(self.link.borrow().participant().node())?)
    }

    /// Says what does not work although the module is on, until it says something else; empty: all works. `list`,
    /// `status` and `top` show it.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn look_at_the_disk(context: &mut Context, is_full: bool) {
    ///     context.complain(if is_full { "the disk is full: nothing is kept" } else { "" });
    /// }
    /// ```
    pub fn complain(&mut self, complaint: impl Into<String>) {
        self.complaint = complaint.into();
    }

    /// A proxy of the module that a setting names, such as `motor.0`.
    ///
    /// ```
    /// # use rohrpost_modules::{interfaces::MotorProxy, runtime::{Context, ContextError}};
    /// fn motor(context: &Context) -> Result<MotorProxy, ContextError> {
    ///     context.proxy("motor.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// When the text names no module, or one of another class.
    pub fn proxy<P: Proxy>(&self, module: &str) -> Result<P, ContextError> {
        let (name, is_beyond) = self.of_class(module, P::CLASS)?;
        self.warn_undeclared(module, name, is_beyond, Wish::Call);
        Ok(P::new(&self.link, name))
    }

    /// A module that this one sends commands to, by the text of a setting: for programs that know its interface by a
    /// description alone.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn motor(context: &Context) -> Result<rohrpost_mailbox::Name, ContextError> {
    ///     context.callee("motor.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// When the text names no module.
    pub fn callee(&self, module: &str) -> Result<Name, ContextError> {
        let (name, is_beyond) = self.parsed(module)?;
        self.warn_undeclared(module, name, is_beyond, Wish::Call);
        Ok(name)
    }

    /// A module that this one subscribes to, by the text of a setting: for programs that know its interface by a
    /// description alone.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn laser(context: &Context) -> Result<rohrpost_mailbox::Name, ContextError> {
    ///     context.publisher("laser.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// When the text names no module.
    pub fn publisher(&self, module: &str) -> Result<Name, ContextError> {
        let (name, is_beyond) = self.parsed(module)?;
        self.warn_undeclared(module, name, is_beyond, Wish::Subscribe);
        Ok(name)
    }

    /// A module by the text of a setting, of which this one only reads streams: `calls` need not name it.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn camera(context: &Context) -> Result<rohrpost_mailbox::Name, ContextError> {
    ///     context.module_named("camera.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// When the text names no module.
    pub fn module_named(&self, module: &str) -> Result<Name, ContextError> {
        Ok(self.parsed(module)?.0)
    }

    /// The link that proxies are made of.
    ///
    /// ```
    /// # use rohrpost_modules::{interface::Proxy, interfaces::MotorProxy, runtime::Context};
    /// fn motor(context: &Context, module: rohrpost_mailbox::Name) -> MotorProxy {
    ///     MotorProxy::new(context.link(), module) // without a look at `calls`
    /// }
    /// ```
    pub fn link(&self) -> &Caller {
        &self.link
    }

    /// A module that this one subscribes to.
    fn named(&self, module: &str, wanted: &'static str) -> Result<Name, ContextError> {
        let (name, is_beyond) = self.of_class(module, wanted)?;
        self.warn_undeclared(module, name, is_beyond, Wish::Subscribe);
        Ok(name)
    }

    /// The configuration counts on `calls`: how many slots a mailbox needs, and that nobody waits for a less important
    /// module.
    fn warn_undeclared(&self, module: &str, name: Name, is_beyond: bool, wish: Wish) {
        let Some(me) = self.installation.module(self.me).filter(|_| !is_beyond) else { return };
        if !me.calls.contains(&name) {
            tracing::warn!(
                "it calls {module}, which its `calls` does not name; add it, so that `check` can count on it"
            );
        } else if wish == Wish::Call && me.downwards.subscribes(name) {
            tracing::warn!(
                "it calls {module}, and its `calls` says that it only subscribes; drop `subscribes = true` there"
            );
        }
    }

    /// A module of this class, and whether it is beyond the LAN.
    fn of_class(&self, module: &str, wanted: &'static str) -> Result<(Name, bool), ContextError> {
        let (name, is_beyond) = self.parsed(module)?;
        let class = self.installation.classes.name(name.class()).unwrap_or_default();
        if class != wanted {
            return Err(ContextError::Class { module: module.into(), class: class.into(), wanted });
        }
        Ok((name, is_beyond))
    }

    /// A module, and whether it is beyond the LAN: that has a name of four parts, and stands in another configuration.
    fn parsed(&self, module: &str) -> Result<(Name, bool), ContextError> {
        let classes = &self.installation.classes;
        let is_beyond = self.installation.reaches_others() && module.split('.').count() == 4;
        let name = if is_beyond { classes.parse_name(module)?.module() } else { classes.parse_module(module)? };
        Ok((name, is_beyond))
    }
}
