//! What a module can ask of its runtime.

use super::endpoint::Endpoint;
use super::error::ContextError;
use super::follow::{Followings, Rate, Subscription};
use super::refusals::Refusals;
use crate::call::append;
use crate::call::{Caller, Link};
use crate::common::DataHead;
use crate::interface::{DataPort, Proxy};
use crate::publish::{Delivery, Newest, Subscriptions};
use rohrpost_config::{ClassTable, Installation, Principal};
use rohrpost_mailbox::{
    CreateError, Head, Interest, Label, Name, Options, OverflowPolicy, Publications, Receiver, SendError, Shape,
    SystemClock, SystemTime, Type, Watch, Watches, local,
};
use rohrpost_schema::Data;
use std::cell::RefCell;
use std::io;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Shorter ones leave no time for anything else; longer ones are never.
const PERIOD_MIN: Duration = Duration::from_micros(10);
const PERIOD_MAX: Duration = Duration::from_secs(86_400);

/// A module's connection to its node: proxies, subscriptions, publishing, time, settings.
///
/// ```
/// use rohrpost_modules::interfaces::WheelsInterface;
/// use rohrpost_modules::runtime::{Context, ContextError, Rate, Subscription};
/// use rohrpost_modules::types::Odometry;
///
/// fn prepare(context: &mut Context) -> Result<Subscription<Odometry>, ContextError> {
///     context.set_period(std::time::Duration::from_millis(100));
///     context.subscribe(WheelsInterface::ODOMETRY, "odometry.0", Rate::Each)
/// }
/// ```
pub struct Context {
    pub(crate) me: Name,
    pub(crate) installation: Arc<Installation>,
    pub(crate) link: Caller,
    pub(crate) endpoints: Vec<Name>,
    /// Of each endpoint, the hash of the interface that the module serves there, if it serves one.
    served: Vec<Option<u32>>,
    /// Numbers and names of the functions of all of them.
    pub(crate) functions: Vec<(u16, String)>,
    pub(crate) newest: Vec<Newest>,
    /// Counts what is published.
    publications: Publications,
    pub(crate) subscriptions: Subscriptions,
    pub(crate) followings: Followings,
    pub(crate) refusals: Refusals,
    pub(crate) clock: SystemClock,
    /// Mailboxes of the module's own, besides commands, replies and data.
    pub(crate) own: Vec<Receiver>,
    /// Mailboxes that take subscribed data, by local id, and whether only the newest counts there.
    taking: Vec<(u8, bool)>,
    /// Mailboxes that take data from all.
    open: Vec<u8>,
    /// Descriptors that the module waits for; none as long as it never asked.
    pub(crate) watches: Option<Watches>,
    pub(crate) period: Option<Duration>,
    pub(crate) next_tick: Option<Instant>,
    scratch: Vec<u8>,
}

impl Context {
    pub(crate) fn new(
        me: Name,
        installation: Arc<Installation>,
        link: Link,
        endpoints: Vec<Name>,
        clock: SystemClock,
        data: &Shape,
    ) -> Self {
        let publications = Publications::new(link.participant());
        let followings = Followings::of(link.incarnation());
        let named: Vec<Principal> = endpoints.iter().flat_map(|endpoint| installation.callers(*endpoint)).collect();
        let subscriptions = Subscriptions::new(&named);
        Self {
            me,
            installation,
            link: Rc::new(RefCell::new(link)),
            endpoints,
            served: Vec::new(),
            functions: Vec::new(),
            newest: Vec::new(),
            publications,
            subscriptions,
            followings,
            refusals: Refusals::default(),
            clock,
            own: Vec::new(),
            taking: vec![(local::DATA, data.full == OverflowPolicy::Latest)],
            open: Vec::new(),
            watches: None,
            period: None,
            next_tick: None,
            scratch: Vec::new(),
        }
    }

    /// Under its names the module serves these interfaces.
    pub(super) fn serves<M>(&mut self, endpoints: &[Endpoint<M>]) {
        self.served = endpoints.iter().map(|endpoint| endpoint.offer.serve.map(|_| endpoint.offer.hash)).collect();
        self.functions = endpoints.iter().flat_map(|endpoint| endpoint.offer.functions.iter().cloned()).collect();
    }

    /// The module's own name.
    pub fn me(&self) -> Name {
        self.me
    }

    /// The configuration that it runs under.
    pub fn installation(&self) -> &Installation {
        &self.installation
    }

    /// Resolves a path of the settings, relative to the configuration file's folder.
    pub fn path(&self, path: &str) -> PathBuf {
        self.installation.resolve(path)
    }

    /// System time now, with its error bound and age; its field `ns` is ns since 1970.
    pub fn now(&self) -> SystemTime {
        self.clock.now()
    }

    /// The clock that system time is read from, to keep.
    pub fn clock(&self) -> &SystemClock {
        &self.clock
    }

    /// Asks for [`crate::Module::tick`] once in this time, from now on; at least 10 µs, at most a day. Ticks that come
    /// too late because the one before took too long are left out.
    pub fn set_period(&mut self, period: Duration) {
        self.period = Some(period.clamp(PERIOD_MIN, PERIOD_MAX));
        self.next_tick = Some(Instant::now());
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
        Ok(P::new(&self.link, self.named(module, P::CLASS)?))
    }

    /// The link that proxies are made of.
    pub fn link(&self) -> &Caller {
        &self.link
    }

    /// Subscribes to data of the module that a setting names. The subscription is kept alive, and asked for anew when
    /// that module is restarted.
    ///
    /// # Errors
    /// When the text names no module, or one of another class.
    pub fn subscribe<T: Data>(
        &mut self,
        port: DataPort<T>,
        module: &str,
        rate: Rate,
    ) -> Result<Subscription<T>, ContextError> {
        self.subscribe_in(local::DATA, port, module, rate)
    }

    /// The same, but the data come to a mailbox of the module's own, which [`Context::open_mailbox`] has made: one with
    /// another policy than the data mailbox has, or one that others cannot fill.
    ///
    /// # Errors
    /// [`ContextError::NoMailbox`] too, when there is no such mailbox.
    pub fn subscribe_in<T: Data>(
        &mut self,
        mailbox: u8,
        port: DataPort<T>,
        module: &str,
        rate: Rate,
    ) -> Result<Subscription<T>, ContextError> {
        let from = self.named(module, port.class)?;
        self.follow(mailbox, from, port.number, (port.hash)(), rate)
    }

    /// Subscribes to data of a type that is known by its description alone. They come to `mailbox`: [`local::DATA`], or
    /// one of the module's own.
    ///
    /// # Errors
    /// [`ContextError::NoMailbox`], when there is no such mailbox.
    pub fn subscribe_untyped(
        &mut self,
        mailbox: u8,
        from: Name,
        number: u16,
        interface: u32,
        rate: Rate,
    ) -> Result<Subscription<()>, ContextError> {
        self.follow(mailbox, from, number, interface, rate)
    }

    fn follow<T>(
        &mut self,
        mailbox: u8,
        from: Name,
        number: u16,
        interface: u32,
        rate: Rate,
    ) -> Result<Subscription<T>, ContextError> {
        let known = self.taking.iter().copied().find(|(local, _)| *local == mailbox);
        let (mailbox, latest) = known.ok_or(ContextError::NoMailbox(mailbox))?;
        let followed = self.followings.follow((mailbox, latest), from, number, interface, rate);
        Ok(Subscription::new(followed.ok_or(ContextError::TooMany)?, mailbox))
    }

    /// Makes a mailbox of the module's own, local id 3 or more, for [`Context::subscribe_in`]. It takes what the module
    /// has subscribed to, and nothing else.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open_mailbox(&mut self, local: u8, shape: Shape) -> Result<(), CreateError> {
        self.make_mailbox(local, shape)?;
        self.taking.push((local, shape.full == OverflowPolicy::Latest));
        Ok(())
    }

    /// Makes a mailbox of the module's own, local id 3 or more, that takes data from all: what comes to it comes to
    /// [`crate::Module::received`] from any sender, if it begins as data do. The module decides which senders it
    /// trusts.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open_mailbox_to_all(&mut self, local: u8, shape: Shape) -> Result<(), CreateError> {
        self.make_mailbox(local, shape)?;
        self.open.push(local);
        Ok(())
    }

    fn make_mailbox(&mut self, local: u8, shape: Shape) -> Result<(), CreateError> {
        let participant = self.link.borrow().participant().clone();
        self.own.push(participant.receiver(self.me.with_local(local), shape)?);
        Ok(())
    }

    /// Whether data may go on to the module: they come to a mailbox that takes them from all, or belong to a
    /// subscription. What may not is counted.
    pub(crate) fn admits(&mut self, (mailbox, latest): (u8, bool), head: &Head, number: u16, data: &DataHead) -> bool {
        if self.open.contains(&mailbox) {
            return true;
        }
        let judged = self.followings.admit((mailbox, latest), head, number, data);
        judged.map_err(|cause| self.refusals.note(cause, head.from)).is_ok()
    }

    /// Waits for a file descriptor too: a serial port, a socket, a pipe, anything that `poll` knows. When there is
    /// something to do [`crate::Module::ready`] is called, while the module is on; until then it waits in the kernel.
    ///
    /// A duplicate is kept until [`Context::unwatch`]: closing one's own descriptor does not end it.
    ///
    /// # Errors
    /// When [`rohrpost_mailbox::WATCHES_MAX`] are watched, the process has no descriptor left, or the pipe by which
    /// senders wake such a receiver cannot be made in the node's directory.
    pub fn watch(&mut self, descriptor: &impl AsFd, interest: Interest) -> io::Result<Watch> {
        let watches = match &mut self.watches {
            Some(watches) => watches,
            none => none.insert(Watches::new(self.link.borrow().participant())?),
        };
        watches.add(descriptor, interest)
    }

    /// Waits for it no longer; false when it was not waited for.
    pub fn unwatch(&mut self, watch: Watch) -> bool {
        self.watches.as_mut().is_some_and(|watches| watches.remove(watch))
    }

    fn named(&self, module: &str, wanted: &'static str) -> Result<Name, ContextError> {
        let classes = &self.installation.classes;
        // What is beyond the LAN has a name of four parts, and stands in another configuration.
        let is_beyond = self.installation.tcp.is_some() && module.split('.').count() == 4;
        let name = if is_beyond { classes.parse_name(module)?.module() } else { classes.parse_module(module)? };
        let class = self.installation.classes.name(name.class()).unwrap_or_default();
        if class != wanted {
            return Err(ContextError::Class { module: module.into(), class: class.into(), wanted });
        }
        // The configuration counts on `calls`: the number of callers decides how many slots a mailbox needs.
        let declared = is_beyond || self.installation.module(self.me).is_none_or(|me| me.calls.contains(&name));
        if !declared {
            tracing::warn!(
                "it calls {module}, which its `calls` does not name; add it, so that `check` can count on it"
            );
        }
        Ok(name)
    }

    /// Publishes a value that was true at `stamp_ns` (system time): it becomes the newest, and goes to all subscribers.
    /// A subscriber with a full mailbox misses it, and sees that it did.
    ///
    /// # Errors
    /// [`ContextError::NoName`], [`ContextError::Undeclared`] or [`ContextError::Encode`].
    pub fn publish<T: Data>(&mut self, port: DataPort<T>, stamp_ns: u64, value: &T) -> Result<(), ContextError> {
        let class = self.installation.classes.id(port.class);
        let endpoint = self.endpoints.iter().position(|endpoint| Some(endpoint.class()) == class);
        let endpoint = endpoint.ok_or(ContextError::NoName(port.class))?;
        self.scratch.clear();
        append(&mut self.scratch, value).map_err(|error| ContextError::Encode(port.name, error))?;
        let at = self.newest_at(endpoint, &port)?;
        let newest = &mut self.newest[at];
        (newest.name, newest.stamp_ns) = (port.name, stamp_ns);
        std::mem::swap(&mut newest.value, &mut self.scratch);
        let (newest, link, endpoints) = (&self.newest[at], &self.link, &self.endpoints);
        let age = Duration::from_nanos(self.clock.now().ns.saturating_sub(stamp_ns));
        self.publications.published(endpoints[endpoint], Type::data(port.number), newest.value.len(), age);
        let classes = &self.installation.classes;
        self.subscriptions.published(newest, |to| deliver(link, classes, endpoints, newest, to));
        Ok(())
    }

    /// Publishes a value that is true now.
    ///
    /// ```
    /// # use rohrpost_modules::{interfaces::WheelsInterface, types::Odometry};
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn publish(context: &mut Context, odometry: &Odometry) -> Result<(), ContextError> {
    ///     context.publish_now(WheelsInterface::ODOMETRY, odometry)
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::publish`].
    pub fn publish_now<T: Data>(&mut self, port: DataPort<T>, value: &T) -> Result<(), ContextError> {
        self.publish(port, self.now().ns, value)
    }

    fn newest_at<T>(&mut self, endpoint: usize, port: &DataPort<T>) -> Result<usize, ContextError> {
        let number = port.number;
        if let Some(at) = self.newest.iter().position(|newest| (newest.endpoint, newest.number) == (endpoint, number)) {
            return Ok(at);
        }
        // Asked once, since what is refused is never the newest.
        if self.served.get(endpoint).copied().flatten() != Some((port.hash)()) {
            let module = self.installation.classes.format(self.endpoints[endpoint]);
            return Err(ContextError::Undeclared { data: port.name, class: port.class, module });
        }
        self.newest.push(Newest { endpoint, number, ..Newest::default() });
        Ok(self.newest.len() - 1)
    }

    /// Delivers periodic data that is due.
    pub(crate) fn deliver_due(&mut self, now_ns: u64) {
        let (all, link, endpoints, classes) = (&self.newest, &self.link, &self.endpoints, &self.installation.classes);
        self.subscriptions.tick(now_ns, |to| {
            match all.iter().find(|newest| (newest.endpoint, newest.number) == (to.endpoint, to.wish.number)) {
                Some(newest) => deliver(link, classes, endpoints, newest, to),
                // Fresh, so there is one.
                None => Delivery::Sent,
            }
        });
    }
}

/// Sends a value to a subscriber.
fn deliver(
    link: &Caller,
    classes: &ClassTable,
    endpoints: &[Name],
    newest: &Newest,
    to: &crate::publish::SubscriptionEntry,
) -> Delivery {
    let asked = &to.asked;
    let (stamp_ns, incarnation) = (newest.stamp_ns, asked.incarnation);
    let head = DataHead { stamp_ns, sequence: to.sequence, missed: to.missed, incarnation };
    let label = Label {
        from: endpoints[newest.endpoint].with_local(local::COMMANDS),
        kind: Type::data(newest.number),
        id: to.wish.id,
        priority: asked.priority,
        options: if asked.newest { Options::STAMPED.with(Options::NEWEST) } else { Options::STAMPED },
    };
    match link.borrow_mut().send(asked.to, &label, &[&head.to_bytes(), &newest.value]) {
        Ok(()) => Delivery::Sent,
        Err(SendError::NoMailbox(_)) => Delivery::Gone,
        Err(SendError::TooLarge { len, max, .. }) => {
            if !to.told {
                let (data, subscriber) = (newest.name, classes.format(asked.to.module()));
                tracing::error!(
                    "`{data}` cannot be delivered to {subscriber}: it has {len} bytes, and the data mailbox there \
                     takes \
                     {max}; raise `size` in [module.mailbox.data] of {subscriber}"
                );
            }
            Delivery::TooLarge
        }
        Err(_) => Delivery::Full,
    }
}
