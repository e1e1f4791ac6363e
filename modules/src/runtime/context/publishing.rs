//! What a module publishes: the newest value of each kind of data, and its way to the subscribers.

use super::Context;
use crate::call::{Caller, append};
use crate::common::DataHead;
use crate::interface::DataPort;
use crate::journal::{ModuleJournal, NotedItem, NotedValue, Tag};
use crate::publish::{Delivery, SubscriptionEntry, Subscriptions};
use crate::runtime::error::ContextError;
use crate::runtime::newest::{Newest, Published};
use crate::runtime::schedule::WorkMoment;
use crate::runtime::stream::OwnStream;
use rohrpost_config::ClassTable;
use rohrpost_mailbox::{BODY_BYTES_MAX, Label, Name, Options, Publications, SendError, SystemClock, Type, local};
use rohrpost_schema::Data;
use std::time::Duration;

impl Context {
    /// Publishes a value that was true at `stamp_ns` (system time): it becomes the newest, and goes to all subscribers.
    /// A subscriber with a full mailbox misses it, and sees that it did.
    ///
    /// ```
    /// # use rohrpost_modules::{interfaces::MotorInterface, types::Twist};
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn publish(context: &mut Context, measured_ns: u64, motion: &Twist) -> Result<(), ContextError> {
    ///     context.publish(MotorInterface::MOTION, measured_ns, motion)
    /// }
    /// ```
    ///
    /// # Errors
    /// [`ContextError::NoName`], [`ContextError::Undeclared`], [`ContextError::IsStream`] or [`ContextError::Encode`].
    pub fn publish<T: Data>(&mut self, port: DataPort<T>, stamp_ns: u64, value: &T) -> Result<(), ContextError> {
        let endpoint = self.endpoint_of(port.class)?;
        self.scratch.clear();
        append(&mut self.scratch, value).map_err(|error| ContextError::Encode(port.name, error))?;
        let at = self.newest_at(endpoint, &port)?;
        let noted = || NotedItem {
            endpoint: endpoint as u16,
            number: port.number,
            stamp_ns,
            value: NotedValue::of(&self.scratch),
        };
        self.journal.output_of(Tag::Published, noted);
        let newest = &mut self.newest[at];
        (newest.name, newest.stamp_ns) = (port.name.into(), stamp_ns);
        std::mem::swap(&mut newest.value, &mut self.scratch);
        let (all, _, mut outlet) = self.split();
        outlet.published(&all[at].published());
        Ok(())
    }

    /// Publishes a value that is true now.
    ///
    /// ```
    /// # use rohrpost_modules::{interfaces::MotorInterface, types::Twist};
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn publish(context: &mut Context, motion: &Twist) -> Result<(), ContextError> {
    ///     context.publish_now(MotorInterface::MOTION, motion)
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::publish`].
    pub fn publish_now<T: Data>(&mut self, port: DataPort<T>, value: &T) -> Result<(), ContextError> {
        self.publish(port, self.now().ns, value)
    }

    /// The place of the endpoint of this class.
    pub(super) fn endpoint_of(&self, class: &'static str) -> Result<usize, ContextError> {
        let id = self.installation.classes.id(class);
        let endpoint = self.endpoints.iter().position(|endpoint| Some(endpoint.class()) == id);
        endpoint.ok_or(ContextError::NoName(class))
    }

    /// Whether the module serves the interface with this hash there.
    pub(super) fn is_declared(&self, endpoint: usize, hash: fn() -> u32) -> bool {
        self.served.get(endpoint).copied().flatten() == Some(hash())
    }

    #[cold]
    pub(super) fn undeclared<T>(&self, endpoint: usize, port: &DataPort<T>) -> ContextError {
        let module = self.installation.classes.format(self.endpoints[endpoint]);
        ContextError::Undeclared { data: port.name, class: port.class, module }
    }

    fn newest_at<T>(&mut self, endpoint: usize, port: &DataPort<T>) -> Result<usize, ContextError> {
        let number = port.number;
        if let Some(at) = self.newest.iter().position(|newest| (newest.endpoint, newest.number) == (endpoint, number)) {
            return Ok(at);
        }
        // Asked once, since what is refused is never the newest.
        if !self.is_declared(endpoint, port.hash) {
            return Err(self.undeclared(endpoint, port));
        }
        if self.streams.iter().any(|stream| stream.is(endpoint, number)) {
            return Err(ContextError::IsStream(port.name));
        }
        self.newest.push(Newest { endpoint, number, ..Newest::default() });
        Ok(self.newest.len() - 1)
    }

    /// What is published, the module's streams, and the way that values take from there.
    pub(super) fn split(&mut self) -> (&[Newest], &mut [OwnStream], Distribution<'_>) {
        let outlet = Distribution {
            link: &self.link,
            classes: &self.installation.classes,
            endpoints: &self.endpoints,
            clock: self.clock.unseen(),
            journal: &self.journal,
            publications: &mut self.publications,
            subscriptions: &mut self.subscriptions,
        };
        (&self.newest, &mut self.streams, outlet)
    }

    /// The newest of this kind of data: kept, or in the ring.
    pub(crate) fn newest_of(&self, endpoint: usize, number: u16) -> Option<Published<'_>> {
        newest_of(&self.newest, &self.streams, endpoint, number)
    }

    /// Looks at the clocks, and delivers periodic data that is due.
    pub(crate) fn deliver_due(&mut self) -> WorkMoment {
        let (now, step) = self.schedule.look();
        if let Some(step) = step {
            self.subscriptions.step(step);
        }
        let (all, streams, link, endpoints) = (&self.newest, &self.streams, &self.link, &self.endpoints);
        let classes = &self.installation.classes;
        self.subscriptions.tick(now, |to| match newest_of(all, streams, to.endpoint, to.wish.number) {
            Some(newest) => deliver(link, classes, endpoints, &newest, to),
            // Fresh, so there is one.
            None => Delivery::Sent,
        });
        now
    }
}

fn newest_of<'v>(all: &'v [Newest], streams: &'v [OwnStream], endpoint: usize, number: u16) -> Option<Published<'v>> {
    if let Some(newest) = all.iter().find(|newest| (newest.endpoint, newest.number) == (endpoint, number)) {
        return Some(newest.published());
    }
    let stream = streams.iter().find(|stream| stream.is(endpoint, number))?;
    let (info, value) = stream.writer.newest()?;
    Some(Published { endpoint, number, name: &stream.about.item.name, stamp_ns: info.stamp.ns, value })
}

/// What a value meets on its way out.
pub(in crate::runtime) struct Distribution<'a> {
    link: &'a Caller,
    classes: &'a ClassTable,
    endpoints: &'a [Name],
    clock: &'a SystemClock,
    pub(in crate::runtime) journal: &'a ModuleJournal,
    publications: &'a mut Publications,
    subscriptions: &'a mut Subscriptions,
}

impl Distribution<'_> {
    /// Counts a new value, and sends it to subscribers of each.
    pub(in crate::runtime) fn published(&mut self, newest: &Published<'_>) {
        let (link, classes, endpoints) = (self.link, self.classes, self.endpoints);
        let age = Duration::from_nanos(self.clock.now().ns.saturating_sub(newest.stamp_ns));
        self.publications.published(endpoints[newest.endpoint], Type::data(newest.number), newest.value.len(), age);
        let deliver = |to: &SubscriptionEntry| deliver(link, classes, endpoints, newest, to);
        self.subscriptions.published(newest.endpoint, newest.number, deliver);
    }
}

/// Sends a value to a subscriber.
fn deliver(
    link: &Caller,
    classes: &ClassTable,
    endpoints: &[Name],
    newest: &Published<'_>,
    to: &SubscriptionEntry,
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
    match link.unseen().borrow_mut().send(asked.to, &label, &[&head.to_bytes(), newest.value]) {
        Ok(()) => Delivery::Sent,
        Err(SendError::NoMailbox(_)) => Delivery::Gone,
        Err(SendError::TooLarge { len, max, .. }) => {
            if !to.told {
                tell_too_large(newest.name, &classes.format(asked.to.module()), len, max);
            }
            Delivery::TooLarge
        }
        Err(_) => Delivery::Full,
    }
}

#[cold]
fn tell_too_large(data: &str, subscriber: &str, len: usize, max: usize) {
    if len > BODY_BYTES_MAX {
        tracing::error!(
            "`{data}` cannot be delivered to {subscriber}: it has {len} bytes, and no package takes more than \
             {BODY_BYTES_MAX}; read the stream on its own node instead (`subscribe_stream`)"
        );
    } else {
        tracing::error!(
            "`{data}` cannot be delivered to {subscriber}: it has {len} bytes, and the data mailbox there takes {max}; \
             raise `size` in [module.mailbox.data] of {subscriber}"
        );
    }
}
