//! One item that is recorded: where it comes from, and whether what comes is wanted.

use super::blame::Omitted;
use super::earlier::EarlierFiles;
use super::sampler::{Numbering, Sampler};
use rohrpost::common::OutputLevel;
use rohrpost::output::OutputLine;
use rohrpost::schema::DataItem;
use rohrpost::wire::from_bytes;
use rohrpost::{
    Context, ContextError, ModuleError, Moment, Name, Rate, Received, StreamSubscription, Subscription, SystemTime,
};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{StreamId, local};
use rohrpost_modules::journal::{JOURNAL_NUMBER, WHOLE_BYTES_MAX};
use rohrpost_recording::format::topic;
use rohrpost_recording::{ChannelId, ChannelSpec, Message, Writer};
use std::collections::BTreeMap;

/// One item of a module.
pub(super) struct Tap {
    pub(super) from: Name,
    pub(super) module: String,
    pub(super) item: DataItem,
    /// Hash of its interface.
    pub(super) interface: u32,
    /// What its channel says besides.
    pub(super) texts: BTreeMap<String, String>,
    pub(super) sampling: Sampling,
    pub(super) sampler: Sampler,
    /// The publisher is on this node.
    pub(super) is_near: bool,
    /// The tap goes on behind an earlier process: what is missing before the first record went while there was none.
    pub(super) is_resumed: bool,
    /// Lines of output: from this level on.
    pub(super) least: Option<OutputLevel>,
    /// None: not yet, or it cannot be opened.
    pub(super) source: Option<Source>,
    /// Why it could not be opened, or a message of it not be recorded, so that it is told once.
    pub(super) refusal: String,
    /// Of the present writer.
    pub(super) channel: Option<ChannelId>,
}

/// How values come.
pub(super) enum Source {
    Data(Subscription<()>),
    Stream(StreamSubscription<()>),
}

impl Tap {
    /// Where it is recorded. A module that describes one name with two types is recorded without the second one.
    pub(super) fn open_channel(&mut self, writer: &mut Writer) {
        let (name, item) = (&self.module, &self.item.field);
        let opened = writer.channel(&ChannelSpec { name, item: &item.name, ty: &item.ty, texts: self.texts.clone() });
        if let Err(error) = &opened {
            tracing::error!("{name}/{} is not recorded: {error}", item.name);
        }
        self.channel = opened.ok();
    }

    /// Subscribes. A stream that has no seat left is tried again. `names_long`: journals may name long records.
    pub(super) fn open(
        &mut self,
        context: &mut Context,
        earlier: &EarlierFiles,
        names_long: bool,
    ) -> Result<(), ModuleError> {
        let opened = match (self.sampler.numbering(), self.sampling) {
            (Numbering::Records, _) => {
                context.subscribe_stream_untyped(self.from, &self.item, self.interface).map(Source::Stream)
            }
            (Numbering::Packages, sampling) => {
                let rate = match sampling {
                    Sampling::Rate(rate_hz) => Rate::hz(rate_hz)?,
                    Sampling::Each | Sampling::Every(_) => Rate::Each,
                };
                let number = self.item.number;
                context.subscribe_untyped(local::DATA, self.from, number, self.interface, rate).map(Source::Data)
            }
        };
        match opened {
            Ok(source) => {
                if let (Source::Stream(subscription), Sampling::Each | Sampling::Every(_)) = (&source, self.sampling) {
                    self.go_back(context, subscription, earlier, names_long);
                }
                self.source = Some(source);
                self.refusal.clear();
            }
            Err(ContextError::Read(error)) => {
                let text = error.to_string();
                if self.refusal != text {
                    tracing::error!("{}/{} is not recorded yet: {text}", self.module, self.item.field.name);
                    self.refusal = text;
                }
            }
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }

    /// Whether also those of its records are recorded that were written before the recorder came: of a journal, and of
    /// a stream of records that journals may name.
    pub(super) fn is_whole(&self, context: &Context) -> bool {
        if (self.sampler.numbering(), self.sampling) != (Numbering::Records, Sampling::Each) {
            return false;
        }
        let info = context.link().borrow().participant().node().inspect_stream(self.id()).ok().flatten();
        self.is_journal() || info.is_some_and(|info| info.shape.record_bytes as usize > WHOLE_BYTES_MAX)
    }

    fn id(&self) -> StreamId {
        StreamId { name: self.from, number: self.item.number }
    }

    fn is_journal(&self) -> bool {
        self.item.number == JOURNAL_NUMBER
    }

    /// A stream is recorded from behind the last record in a file of an earlier process on. If there is none, one of
    /// records that journals may name is recorded from the oldest one on that is kept.
    fn go_back(
        &mut self,
        context: &mut Context,
        subscription: &StreamSubscription<()>,
        earlier: &EarlierFiles,
        names_long: bool,
    ) {
        let participant = context.link().borrow().participant().clone();
        let is_whole = (names_long || self.is_journal()) && self.is_whole(context);
        let behind = earlier.behind(&topic(&self.module, &self.item.field.name), &participant, self.id());
        self.is_resumed = behind.is_some();
        match behind {
            Some(sequence) if is_whole => context.rewind_to(subscription, sequence),
            Some(sequence) => context.resume_at(subscription, sequence),
            // A journal begins with the oldest one by itself.
            None if is_whole && !self.is_journal() => context.rewind(subscription),
            None => {}
        }
    }

    /// What a value is that did not come.
    pub(super) fn omitted(&self) -> Omitted {
        match self.sampler.numbering() {
            Numbering::Records if self.is_resumed => Omitted::EarlierRecord,
            Numbering::Records => Omitted::Record,
            Numbering::Packages if self.is_near => Omitted::NearPackage,
            Numbering::Packages => Omitted::FarPackage,
        }
    }

    pub(super) fn has_brought(&self, data: &Received<'_>) -> bool {
        match &self.source {
            Some(Source::Data(subscription)) => data.is_of(subscription),
            Some(Source::Stream(subscription)) => data.is_of(subscription),
            None => false,
        }
    }

    /// A line of output may be less important than those that are wanted. One that cannot be read is kept: it is what
    /// came.
    pub(super) fn is_important(&self, data: &Received<'_>) -> bool {
        let Some(least) = self.least else { return true };
        from_bytes::<OutputLine>(data.value).map_or(true, |line| line.level <= least)
    }
}

/// A value that came, as it is recorded.
pub(super) fn message<'a>(now: &SystemTime, data: &Received<'a>) -> Message<'a> {
    let (epoch, stamp_ns) = match data.moment() {
        Moment::Stamp(stamp) => (stamp.epoch, stamp.ns),
        Moment::Ns(ns) => (now.epoch, ns),
    };
    Message { arrival_ns: now.ns, stamp_ns, epoch, sequence: data.head.sequence, data: data.value }
}
