//! What a module receives: subscriptions, and mailboxes of its own that take data.

use super::Context;
use crate::common::DataHead;
use crate::interface::DataPort;
use crate::journal::{Question, Tag, nanoseconds};
use crate::runtime::error::ContextError;
use crate::runtime::follow::{Rate, Subscription};
use crate::runtime::wanted::WantedData;
use rohrpost_mailbox::{CreateError, Head, Name, OverflowPolicy, Shape, local};
use rohrpost_schema::Data;

impl Context {
    /// Subscribes to data of the module that a setting names. The subscription is kept alive, and asked for anew when
    /// that module is restarted.
    ///
    /// ```
    /// # use rohrpost_modules::{interfaces::WheelsInterface, types::Odometry};
    /// # use rohrpost_modules::runtime::{Context, ContextError, Rate, Subscription};
    /// fn follow(context: &mut Context) -> Result<Subscription<Odometry>, ContextError> {
    ///     let ten_hz = Rate::Every(std::time::Duration::from_millis(100));
    ///     context.subscribe(WheelsInterface::ODOMETRY.data(), "odometry.0", ten_hz)
    /// }
    /// ```
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
    /// ```
    /// # use rohrpost_modules::{ModuleError, interfaces::WheelsInterface, types::Odometry};
    /// # use rohrpost_modules::runtime::{Context, Rate, Subscription};
    /// # use rohrpost_mailbox::{OverflowPolicy, Shape};
    /// const NEWEST: u8 = 3;
    ///
    /// fn follow(context: &mut Context) -> Result<Subscription<Odometry>, ModuleError> {
    ///     context.open_mailbox(NEWEST, Shape { full: OverflowPolicy::Latest, ..Shape::default() })?;
    ///     Ok(context.subscribe_in(NEWEST, WheelsInterface::ODOMETRY.data(), "odometry.0", Rate::Each)?)
    /// }
    /// ```
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
        let wanted = WantedData { name: port.name, ty: T::schema() };
        self.follow(mailbox, from, port.number, (port.hash)(), rate, Some(wanted))
    }

    /// Subscribes to data of a type that is known by its description alone. They come to `mailbox`: [`local::DATA`], or
    /// one of the module's own.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError, Rate, Subscription};
    /// # use rohrpost_mailbox::{Name, local};
    /// fn follow_all(
    ///     context: &mut Context,
    ///     from: Name,
    ///     description: &rohrpost_schema::Description,
    /// ) -> Result<Vec<Subscription<()>>, ContextError> {
    ///     let numbers = description.data.iter().map(|item| item.number);
    ///     let follow = |number| context.subscribe_untyped(local::DATA, from, number, description.hash(), Rate::Each);
    ///     numbers.map(follow).collect()
    /// }
    /// ```
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
        self.follow(mailbox, from, number, interface, rate, None)
    }

    fn follow<T>(
        &mut self,
        mailbox: u8,
        from: Name,
        number: u16,
        interface: u32,
        rate: Rate,
        wanted: Option<WantedData>,
    ) -> Result<Subscription<T>, ContextError> {
        let known = self.taking.iter().copied().find(|(local, _)| *local == mailbox);
        let (mailbox, latest) = known.ok_or(ContextError::NoMailbox(mailbox))?;
        let period_ns = match rate {
            Rate::Each => None,
            Rate::Every(period) => Some(nanoseconds(period)),
        };
        self.journal.asked(Tag::Subscribed, Question::Data { from: from.raw(), number, interface, mailbox, period_ns });
        let followed = self.followings.follow((mailbox, latest), from, number, interface, rate, wanted);
        Ok(Subscription::new(followed.ok_or(ContextError::TooMany)?, mailbox))
    }

    /// Makes a mailbox of the module's own, local id 3 or more, for [`Context::subscribe_in`]. It takes what the module
    /// has subscribed to, and nothing else.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// # use rohrpost_mailbox::{CreateError, Shape};
    /// fn open(context: &mut Context) -> Result<(), CreateError> {
    ///     context.open_mailbox(3, Shape { slots: 4, body_bytes_max: 1024, ..Shape::default() })
    /// }
    /// ```
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open_mailbox(&mut self, local: u8, shape: Shape) -> Result<(), CreateError> {
        self.make_mailbox(local, shape, false)?;
        self.taking.push((local, shape.full == OverflowPolicy::Latest));
        Ok(())
    }

    /// Makes a mailbox of the module's own, local id 3 or more, that takes data from all: what comes to it comes to
    /// [`crate::Module::received`] from any sender, if it begins as data do. The module decides which senders it
    /// trusts.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, Received, Unreadable};
    /// # use rohrpost_mailbox::{CreateError, Shape};
    /// const REPORTS: u8 = 3;
    ///
    /// fn open(context: &mut Context) -> Result<(), CreateError> {
    ///     context.open_mailbox_to_all(REPORTS, Shape::default())
    /// }
    ///
    /// fn battery_v(data: &Received<'_>) -> Result<Option<f32>, Unreadable> {
    ///     data.read_from(REPORTS)
    /// }
    /// ```
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open_mailbox_to_all(&mut self, local: u8, shape: Shape) -> Result<(), CreateError> {
        self.make_mailbox(local, shape, true)?;
        self.open.push(local);
        Ok(())
    }

    fn make_mailbox(&mut self, local: u8, shape: Shape, is_to_all: bool) -> Result<(), CreateError> {
        let Shape { slots, body_bytes_max: bytes, .. } = shape;
        self.journal.asked(Tag::MadeMailbox, Question::Mailbox { local, slots, bytes, is_to_all });
        let participant = self.link.unseen().borrow().participant().clone();
        let made = participant.receiver(self.me.with_local(local), shape);
        if made.is_err() {
            // Where it is replayed, it can be made.
            self.journal.hole("a mailbox of the module could not be made");
        }
        self.own.push(made?);
        Ok(())
    }

    /// Whether data may go on to the module: they come to a mailbox that takes them from all, or belong to a
    /// subscription. What may not is counted.
    pub(crate) fn admits(&mut self, (mailbox, latest): (u8, bool), head: &Head, number: u16, data: &DataHead) -> bool {
        if self.open.contains(&mailbox) {
            return true;
        }
        let validated = self.followings.admit((mailbox, latest), head, number, data);
        validated.map_err(|cause| self.refusals.note(cause, head.from)).is_ok()
    }
}
