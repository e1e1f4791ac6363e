//! Streams: what a module writes into its own, and how it reads those of others.

use super::Context;
use crate::interface::StreamPort;
use crate::journal::{AskedStream, Question, Tag};
use crate::runtime::error::ContextError;
use crate::runtime::stream::{
    CheckedReader, KnownStream, OpenValue, OwnStream, RecordError, Stream, StreamSubscription, note, opened,
};
use rohrpost_mailbox::{Name, Stamp, StreamId};
use rohrpost_schema::{Data, DataItem};

/// How it is asked for a stream of an interface.
type OpenQuestion = fn(AskedStream, u32) -> Question<'static>;

impl Context {
    /// Writes a value that was true at `stamp_ns` (system time) into the module's stream: straight into shared memory,
    /// without a copy between. Returns its sequence, which counts the stream's records. It is published as well:
    /// counted as data are, and sent to subscribers where it fits a package. Slow or stopped readers do not matter.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// use rohrpost_modules::{interface, types::Pose};
    ///
    /// /// Knows where it hangs.
    /// #[interface(class = "crane", crate = rohrpost_modules::macro_support)]
    /// pub trait Crane {
    ///     /// Where its hook hangs.
    ///     #[stream(1)]
    ///     fn hook() -> Pose;
    /// }
    ///
    /// fn measured(context: &mut Context, measured_ns: u64, hook: &Pose) -> Result<(), ContextError> {
    ///     let sequence = context.write(CraneInterface::HOOK, measured_ns, hook)?;
    ///     tracing::trace!("record {sequence}");
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// [`ContextError::NoName`], [`ContextError::Undeclared`], or [`ContextError::Record`]: too large, or too late.
    pub fn write<T: Data>(&mut self, port: StreamPort<T>, stamp_ns: u64, value: &T) -> Result<u64, ContextError> {
        let mut open = self.begin(port, stamp_ns)?;
        open.put(value)?;
        open.finish()
    }

    /// Writes a value that is true now.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// # use rohrpost_modules::interface::StreamPort;
    /// fn weighed(context: &mut Context, port: StreamPort<f64>, mass_kg: f64) -> Result<u64, ContextError> {
    ///     context.write_now(port, &mass_kg)
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::write`].
    pub fn write_now<T: Data>(&mut self, port: StreamPort<T>, value: &T) -> Result<u64, ContextError> {
        self.write(port, self.now().ns, value)
    }

    /// Begins a value that is to be filled in place in shared memory, such as a picture that a driver reads there:
    /// [`OpenValue::fill`], then [`OpenValue::finish`]. Dropped unfinished, nothing happened.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError};
    /// # use rohrpost_modules::{interface::StreamPort, schema::Bytes};
    /// fn blank(context: &mut Context, port: StreamPort<(u32, Bytes)>, stamp_ns: u64) -> Result<u64, ContextError> {
    ///     let mut open = context.begin(port, stamp_ns)?;
    ///     open.fill(&(640, Bytes::default()), 640 * 480)?.fill(0);
    ///     open.finish()
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::write`].
    pub fn begin<T: Data>(&mut self, port: StreamPort<T>, stamp_ns: u64) -> Result<OpenValue<'_, T>, ContextError> {
        let endpoint = self.endpoint_of(port.class)?;
        let at = self.streams.iter().position(|stream| stream.is(endpoint, port.number));
        let is_declared = self.is_declared(endpoint, port.hash);
        let Some(at) = at.filter(|_| is_declared) else { return Err(self.undeclared(endpoint, &port.data())) };
        self.begin_at(at, None, stamp_ns)
    }

    /// The next record of a stream, of the present epoch if no other is named. A journal has what its time's epoch is,
    /// which number it will have, or why it cannot be written.
    pub(super) fn begin_at<T: Data>(
        &mut self,
        at: usize,
        epoch: Option<u64>,
        stamp_ns: u64,
    ) -> Result<OpenValue<'_, T>, ContextError> {
        let epoch = epoch.unwrap_or_else(|| self.clock.unseen().now().epoch);
        let (_, streams, outlet) = self.split();
        let OwnStream { about, writer } = &mut streams[at];
        let journal = outlet.journal;
        let question = Question::Own { endpoint: about.endpoint as u16, number: about.item.number, stamp_ns };
        let noted = journal.given(Tag::Wrote, question).map(|given| given.read::<Result<(u64, u64), RecordError>>());
        let (epoch, sequence) = noted.unwrap_or_else(|| Ok((epoch, writer.written())))?;
        match writer.begin(Stamp { epoch, ns: stamp_ns }) {
            Ok(record) => {
                journal.note(Tag::Wrote, question, &Ok::<_, RecordError>((epoch, sequence)));
                Ok(OpenValue::new(record, (sequence, stamp_ns), about, outlet))
            }
            Err(error) => {
                let error = about.explain(error);
                journal.replay(|replay| replay.give_up(&format!("a record that was written is refused now: {error}")));
                journal.note(Tag::Wrote, question, &Err::<(u64, u64), _>(&error));
                Err(error.into())
            }
        }
    }

    /// Opens a stream of another module of this node, or one of which this node has a replica, to look at when the
    /// module likes: its newest record, the next one, or what was there at a time. It begins with what is written next.
    /// The stream need not be there yet.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError, Stream};
    /// # use rohrpost_modules::{interface::StreamPort, types::Pose};
    /// fn open(context: &mut Context, hook: StreamPort<Pose>) -> Result<Stream<Pose>, ContextError> {
    ///     Ok(context.stream(hook, "crane.0")?.with_gap(std::time::Duration::from_millis(500)))
    /// }
    /// ```
    ///
    /// # Errors
    /// When the text names no module, one of another class, or one of another node ([`ContextError::FarStream`]), and
    /// [`ContextError::Read`] when all seats of the stream are taken.
    pub fn stream<T: Data>(&mut self, port: StreamPort<T>, module: &str) -> Result<Stream<T>, ContextError> {
        Ok(Stream::new(self.open_stream(&port, module, Question::Interface)?, self.clock.clone()))
    }

    /// Opens a stream of which the type is known by its description alone, such as one that a view draws. Each record's
    /// bytes ([`super::super::Record::bytes`]) are of the type of `item`, a stream of the interface that describes
    /// itself by `interface`, the description's hash: read them by the description, or as a type that it says.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError, Stream, StreamReadError};
    /// use rohrpost_modules::schema::{DataItem, Description, decode};
    /// # use rohrpost_mailbox::Name;
    ///
    /// fn open(
    ///     context: &mut Context,
    ///     from: Name,
    ///     description: &Description,
    /// ) -> Result<Vec<(DataItem, Stream<()>)>, ContextError> {
    ///     let open = |item: &DataItem| {
    ///         Ok((item.clone(), context.stream_untyped(from, item, description.hash())?))
    ///     };
    ///     description.streams().map(open).collect()
    /// }
    ///
    /// fn print_newest(item: &DataItem, stream: &mut Stream<()>) -> Result<(), StreamReadError> {
    ///     if let Some(record) = stream.newest()? {
    ///         println!("{}: {:?}", item.field.name, decode(&item.field.ty, record.bytes()));
    ///     }
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// [`ContextError::FarStream`] for a module of another node, and [`ContextError::Read`] when all seats of the
    /// stream are taken.
    pub fn stream_untyped(&mut self, from: Name, item: &DataItem, interface: u32) -> Result<Stream<()>, ContextError> {
        Ok(Stream::new(self.open_untyped(from, item, interface, Question::Interface)?, self.clock.clone()))
    }

    /// Follows a stream of another module of this node: each record comes to [`crate::Module::received`], while this
    /// module is on, and lies in shared memory while it looks. Records that were overwritten before it came to them are
    /// counted in `data.head.missed`.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError, Received, StreamSubscription};
    /// # use rohrpost_modules::{ModuleError, interface::StreamPort, types::Pose};
    /// fn follow(context: &mut Context, hook: StreamPort<Pose>) -> Result<StreamSubscription<Pose>, ContextError> {
    ///     context.subscribe_stream(hook, "crane.0")
    /// }
    ///
    /// fn received(data: &Received<'_>, hook: &StreamSubscription<Pose>) -> Result<(), ModuleError> {
    ///     if let Some(pose) = data.read(hook)? {
    ///         tracing::info!("it hangs at {} m, {} records lost so far", pose.x_m, data.head.missed);
    ///     }
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::stream`].
    pub fn subscribe_stream<T: Data>(
        &mut self,
        port: StreamPort<T>,
        module: &str,
    ) -> Result<StreamSubscription<T>, ContextError> {
        let reader = self.open_stream(&port, module, Question::Followed)?;
        self.followed_streams.follow(reader).ok_or(ContextError::TooMany)
    }

    /// The same of a stream of which the type is known by its description alone, as in [`Context::stream_untyped`]:
    /// each record's bytes come in `data.value`.
    ///
    /// ```
    /// # use rohrpost_mailbox::Name;
    /// # use rohrpost_modules::runtime::{Context, ContextError, StreamSubscription};
    /// # use rohrpost_modules::schema::Description;
    /// fn follow_all(
    ///     context: &mut Context,
    ///     from: Name,
    ///     description: &Description,
    /// ) -> Result<Vec<StreamSubscription<()>>, ContextError> {
    ///     let follow = |item| context.subscribe_stream_untyped(from, item, description.hash());
    ///     description.streams().map(follow).collect()
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::stream_untyped`].
    pub fn subscribe_stream_untyped(
        &mut self,
        from: Name,
        item: &DataItem,
        interface: u32,
    ) -> Result<StreamSubscription<()>, ContextError> {
        let reader = self.open_untyped(from, item, interface, Question::Followed)?;
        self.followed_streams.follow(reader).ok_or(ContextError::TooMany)
    }

    /// Goes back to the oldest record that a followed stream keeps of its present writer: also those come that were
    /// written before it was followed. And at the module's end it is given those that are there by then.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, ContextError, StreamSubscription};
    /// # use rohrpost_modules::{interface::StreamPort, types::Pose};
    /// fn follow_all(context: &mut Context, hook: StreamPort<Pose>) -> Result<StreamSubscription<Pose>, ContextError> {
    ///     let subscription = context.subscribe_stream(hook, "crane.0")?;
    ///     context.rewind(&subscription);
    ///     Ok(subscription)
    /// }
    /// ```
    pub fn rewind<T>(&mut self, subscription: &StreamSubscription<T>) {
        self.journal.asked(Tag::Rewound, Question::Rewound(subscription.id()));
        self.followed_streams.rewind(subscription, None);
    }

    /// As [`Context::rewind`], to the record with this sequence, whichever writer it is of. What is kept no more counts
    /// as lost.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, StreamSubscription};
    /// # use rohrpost_modules::types::Pose;
    /// fn go_on(context: &mut Context, poses: &StreamSubscription<Pose>, last_handled: u64) {
    ///     context.rewind_to(poses, last_handled + 1);
    /// }
    /// ```
    pub fn rewind_to<T>(&mut self, subscription: &StreamSubscription<T>, sequence: u64) {
        self.journal.asked(Tag::Rewound, Question::RewoundTo(subscription.id(), sequence));
        self.followed_streams.rewind(subscription, Some(sequence));
    }

    /// As [`Context::rewind_to`] for a stream that may have gaps: what is written while the module is off is passed
    /// over, as it is without a word.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, StreamSubscription};
    /// # use rohrpost_modules::types::Pose;
    /// fn go_on(context: &mut Context, poses: &StreamSubscription<Pose>, last_handled: u64) {
    ///     context.resume_at(poses, last_handled + 1);
    /// }
    /// ```
    pub fn resume_at<T>(&mut self, subscription: &StreamSubscription<T>, sequence: u64) {
        self.journal.asked(Tag::Rewound, Question::RewoundTo(subscription.id(), sequence));
        self.followed_streams.resume(subscription, sequence);
    }

    /// At the module's end it is given all that came to it until then: records of all streams that it follows, and
    /// data, for up to 5 s: `stop-within` must be longer. For modules that end after those that they listen to.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn begin(context: &mut Context) {
    ///     context.take_all_at_end();
    /// }
    /// ```
    pub fn take_all_at_end(&mut self) {
        self.takes_all_at_end = true;
    }

    fn open_untyped(
        &self,
        from: Name,
        item: &DataItem,
        interface: u32,
        question: OpenQuestion,
    ) -> Result<CheckedReader, ContextError> {
        let known = KnownStream { number: item.number, name: item.field.name.clone().into(), interface };
        let beyond = (from.system() != self.me.system()).then_some("?");
        self.open_known(known, (from, beyond), question, || self.installation.classes.format(from))
    }

    /// Whether this node has a stream of another module, or is to have it: it need not be written yet.
    ///
    /// # Errors
    /// [`ContextError::FarStream`].
    pub fn require_stream(&self, from: Name, stream: &str) -> Result<(), ContextError> {
        let beyond = (from.system() != self.me.system()).then_some("?");
        self.require_stream_here(stream, (from, beyond), || self.installation.classes.format(from))
    }

    fn require_stream_here(
        &self,
        stream: &str,
        (from, beyond): (Name, Option<&str>),
        module: impl FnOnce() -> String,
    ) -> Result<(), ContextError> {
        let node = beyond.or_else(|| self.installation.node_of(from));
        let own = self.installation.node_of(self.me);
        let has_replica = own.is_some_and(|own| self.installation.replica_on(own, from, stream).is_some());
        // What the configuration does not have may be here: a module of a test, say.
        match node.filter(|node| own != Some(node) && !has_replica) {
            Some(node) => Err(ContextError::FarStream { stream: stream.into(), module: module(), node: node.into() }),
            None => Ok(()),
        }
    }

    fn open_stream<T>(
        &self,
        port: &StreamPort<T>,
        module: &str,
        question: OpenQuestion,
    ) -> Result<CheckedReader, ContextError> {
        let (from, is_beyond) = self.of_class(module, port.class)?;
        self.open_known((*port).into(), (from, is_beyond.then_some("?")), question, || module.into())
    }

    /// Opens a stream, which is `beyond` if the node is not of this configuration.
    fn open_known(
        &self,
        known: KnownStream,
        (from, beyond): (Name, Option<&str>),
        question: OpenQuestion,
        module: impl FnOnce() -> String,
    ) -> Result<CheckedReader, ContextError> {
        self.require_stream_here(&known.name, (from, beyond), module)?;
        let participant = self.link.unseen().borrow().participant().clone();
        let id = StreamId { name: from.module(), number: known.number };
        let question = question(id.into(), known.interface);
        let then = opened(&self.journal, question).transpose()?;
        let reader = CheckedReader::open(&participant, &self.installation, known, from);
        if then.is_none() {
            note(&self.journal, Tag::Opened, question, &reader, |_| ());
        }
        Ok(reader?)
    }
}
