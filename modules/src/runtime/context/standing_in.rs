//! Publishing as another module, by its description.

use super::Context;
use crate::journal::{NotedItem, NotedValue, Tag};
use crate::runtime::error::ContextError;
use crate::runtime::newest::Newest;
use crate::runtime::stream::{Moment, OpenValue, OwnStream, SuspendedValue};
use rohrpost_mailbox::Name;

impl Context {
    /// Publishes a value as the module that this one stands in for under the name `from`
    /// ([`crate::Module::stand_ins`]). Its item `number` is data, or a stream, of which this is the next record. The
    /// value is postcard of the type that the description says; nobody looks whether it is. Its time is in ns since
    /// 1970, of the present epoch; a record of a stream may be of an earlier one, with a stamp that says so.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// # use rohrpost_mailbox::Name;
    /// /// Something that was recorded of a module.
    /// struct Recorded {
    ///     from: Name,
    ///     number: u16,
    ///     stamp_ns: u64,
    ///     value: Vec<u8>,
    /// }
    ///
    /// fn play(context: &mut Context, recorded: &Recorded) -> Result<(), ContextError> {
    ///     context.publish_as(recorded.from, recorded.number, recorded.stamp_ns, &recorded.value)
    /// }
    /// ```
    ///
    /// # Errors
    /// [`ContextError::NotStoodIn`], or [`ContextError::Record`]: too large for the stream, or too late.
    pub fn publish_as(
        &mut self,
        from: Name,
        number: u16,
        at: impl Into<Moment>,
        value: &[u8],
    ) -> Result<(), ContextError> {
        let (epoch, stamp_ns) = parts(at.into());
        let endpoint = self.endpoints.iter().position(|name| *name == from.module());
        let stood_in = endpoint.and_then(|endpoint| Some((endpoint, self.stood_in.get(endpoint)?.as_ref()?)));
        let Some((endpoint, data)) = stood_in else { return Err(self.not_stood_in(from, number)) };
        if let Some(at) = self.streams.iter().position(|stream| stream.is(endpoint, number)) {
            return self.write_as(at, epoch, stamp_ns, value);
        }
        let known = self.newest.iter().position(|newest| (newest.endpoint, newest.number) == (endpoint, number));
        let at = match (known, data.iter().find(|(item, _)| *item == number)) {
            (Some(at), _) => at,
            (None, None) => return Err(self.not_stood_in(from, number)),
            (None, Some((_, name))) => {
                self.newest.push(Newest { endpoint, number, name: name.clone().into(), ..Newest::default() });
                self.newest.len() - 1
            }
        };
        let noted = || NotedItem { endpoint: endpoint as u16, number, stamp_ns, value: NotedValue::of(value) };
        self.journal.output_of(Tag::Published, noted);
        let newest = &mut self.newest[at];
        newest.stamp_ns = stamp_ns;
        newest.value.clear();
        newest.value.extend_from_slice(value);
        let (all, _, mut outlet) = self.split();
        outlet.published(&all[at].published());
        Ok(())
    }

    /// Begins the next record of a stream of the module that this one stands in for, to be filled in place:
    /// [`OpenValue::fill_bytes`], then [`OpenValue::finish`].
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// # use rohrpost_mailbox::Name;
    /// /// A picture: `front` is postcard of its sizes, and of no pixels.
    /// fn blank(context: &mut Context, eye: Name, stamp_ns: u64, front: &[u8]) -> Result<u64, ContextError> {
    ///     let mut open = context.begin_as(eye, 1, stamp_ns)?;
    ///     open.fill_bytes(front, 640 * 480)?.fill(0);
    ///     open.finish()
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::publish_as`].
    pub fn begin_as(
        &mut self,
        from: Name,
        number: u16,
        at: impl Into<Moment>,
    ) -> Result<OpenValue<'_, ()>, ContextError> {
        let (epoch, stamp_ns) = parts(at.into());
        let endpoint = self.endpoints.iter().position(|name| *name == from.module());
        let is_stood_in = |endpoint: &usize| self.stood_in.get(*endpoint).is_some_and(Option::is_some);
        let stream = endpoint
            .filter(is_stood_in)
            .and_then(|endpoint| self.streams.iter().position(|stream| stream.is(endpoint, number)));
        let Some(stream) = stream else { return Err(self.not_stood_in(from, number)) };
        self.begin_at(stream, epoch, stamp_ns)
    }

    /// Takes up a record that was suspended ([`OpenValue::suspend`]); none if it is no stream's of this module, or if
    /// another one of its stream was begun or published since, by which it was given up.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError, OpenValue, SuspendedValue};
    /// fn finish_later(context: &mut Context, begun: SuspendedValue) -> Result<Option<u64>, ContextError> {
    ///     context.resume(begun).map(OpenValue::finish).transpose()
    /// }
    /// ```
    pub fn resume(&mut self, suspended: SuspendedValue) -> Option<OpenValue<'_, ()>> {
        let (_, streams, outlet) = self.split();
        let OwnStream { about, writer } = streams.iter_mut().find(|stream| suspended.is_of(stream))?;
        OpenValue::resumed(suspended, writer, about, outlet)
    }

    /// The next record of a stream.
    fn write_as(&mut self, at: usize, epoch: Option<u64>, stamp_ns: u64, value: &[u8]) -> Result<(), ContextError> {
        let mut open = self.begin_at::<()>(at, epoch, stamp_ns)?;
        open.put_bytes(value)?;
        open.finish().map(drop)
    }

    #[cold]
    fn not_stood_in(&self, from: Name, number: u16) -> ContextError {
        ContextError::NotStoodIn { module: self.installation.classes.format(from.module()), number }
    }
}

/// Its epoch, if it says one, and ns.
fn parts(moment: Moment) -> (Option<u64>, u64) {
    match moment {
        Moment::Stamp(stamp) => (Some(stamp.epoch), stamp.ns),
        Moment::Ns(ns) => (None, ns),
    }
}
