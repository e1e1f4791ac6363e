//! What a module publishes: the newest value of each kind of data, and its way to the subscribers.

use super::Context;
use crate::call::{Caller, append};
use crate::common::DataHead;
use crate::interface::DataPort;
use crate::publish::{Delivery, Newest, SubscriptionEntry};
use crate::runtime::error::ContextError;
use rohrpost_config::ClassTable;
use rohrpost_mailbox::{Label, Name, Options, SendError, Type, local};
use rohrpost_schema::Data;
use std::time::Duration;

impl Context {
    /// Publishes a value that was true at `stamp_ns` (system time): it becomes the newest, and goes to all subscribers.
    /// A subscriber with a full mailbox misses it, and sees that it did.
    ///
    /// ```
    /// # use rohrpost_modules::{interfaces::WheelsInterface, types::Odometry};
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// fn publish(context: &mut Context, measured_ns: u64, odometry: &Odometry) -> Result<(), ContextError> {
    ///     context.publish(WheelsInterface::ODOMETRY, measured_ns, odometry)
    /// }
    /// ```
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
