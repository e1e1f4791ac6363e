//! What is recorded of which module: wanted by the configuration, described by the module, subscribed to.

use super::blame::{Blame, Omitted, mailbox_losses};
use super::earlier::EarlierFiles;
use super::sampler::{Lost, Numbering, Sampler};
use rohrpost::common::OutputLevel;
use rohrpost::description::{DescriptionRequest, noted};
use rohrpost::interface::Interface;
use rohrpost::interfaces::CollectorInterface;
use rohrpost::output::OutputLine;
use rohrpost::schema::{DataItem, DataKind, Description, Field, Type};
use rohrpost::wire::from_bytes;
use rohrpost::{
    Context, ContextError, ModuleError, ModuleState, Moment, Name, Node, Rate, Received, StreamSubscription,
    Subscription, SystemTime,
};
use rohrpost_config::{Installation, RecordedItems, Recording, Sampling};
use rohrpost_mailbox::{StreamId, local};
use rohrpost_modules::journal::{JOURNAL_NAME, JOURNAL_NUMBER, WHOLE_BYTES_MAX};
use rohrpost_recording::format::topic;
use rohrpost_recording::{ChannelId, ChannelSpec, Earlier, Message, WriteError, Writer};
use std::collections::BTreeMap;
use std::time::Instant;

/// The collector's data: lines of output.
const LINE: &str = "line";

/// All that is recorded.
pub(super) struct Taps {
    recording: Recording,
    sources: Vec<SourceModule>,
    taps: Vec<Tap>,
    /// Recorded before this process.
    earlier: EarlierFiles,
    /// Why values do not come.
    blame: Blame,
}

/// A module of which something is wanted.
struct SourceModule {
    from: Name,
    /// As the configuration has it.
    name: String,
    /// The module of its process, if that is on this node.
    own: Option<Name>,
    /// Streams of it of which this node has replicas.
    replicas: Vec<String>,
    /// As it has described itself.
    description: Option<Description>,
    asking: DescriptionRequest,
}

/// One item of a module.
struct Tap {
    from: Name,
    module: String,
    item: DataItem,
    /// Hash of its interface.
    interface: u32,
    /// What its channel says besides.
    texts: BTreeMap<String, String>,
    sampling: Sampling,
    sampler: Sampler,
    /// Its publisher is on this node.
    is_near: bool,
    /// It goes on behind an earlier process: what is missing before the first record went while there was none.
    is_resumed: bool,
    /// Lines of output: from this level on.
    least: Option<OutputLevel>,
    /// None: not yet, or it cannot be opened.
    source: Option<Source>,
    /// Why it could not be opened, or a message of it not be recorded, so that it is told once.
    refusal: String,
    /// Of the present writer.
    channel: Option<ChannelId>,
}

/// How values come.
enum Source {
    Data(Subscription<()>),
    Stream(StreamSubscription<()>),
}

impl Taps {
    /// What the configuration names, as seen from module `own` on its node, where there are files of `earlier`.
    pub(super) fn new(
        installation: &Installation,
        recording: Recording,
        (own, node): (Name, &str),
        earlier: EarlierFiles,
    ) -> Self {
        let replicas = |from: Name| {
            let here = installation.replicas.iter().filter(|replica| replica.from == from);
            here.filter(|replica| replica.to.iter().any(|to| to == node)).map(|replica| replica.item.clone()).collect()
        };
        let source = |from: Name| {
            let host = installation.module(from).filter(|host| host.node == node);
            SourceModule {
                from,
                name: installation.classes.format(from),
                own: host.map(|host| host.name),
                replicas: replicas(from),
                description: None,
                asking: DescriptionRequest::default(),
            }
        };
        let others = installation.modules.iter().filter(|module| module.name != own);
        let names = others.flat_map(|module| module.names().map(move |name| (name, module.is_in_file())));
        let entries = || recording.streams.iter().chain(&recording.data);
        let collector = recording.output.and_then(|_| installation.classes.id(CollectorInterface::CLASS));
        // `*` are those of the file; routers have to be named.
        let is_wanted = |(name, is_in_file): &(Name, bool)| {
            Some(name.class()) == collector
                || recording.is_exact(*name)
                || entries().any(|entry| entry.from.map_or(*is_in_file, |from| from == *name))
        };
        let sources = names.filter(is_wanted).map(|(name, _)| source(name)).collect();
        Self { recording, sources, taps: Vec::new(), earlier, blame: Blame::new() }
    }

    /// A recording begins: what is known already has its channels from the first file on.
    pub(super) fn begin(&mut self, writer: &mut Writer) {
        self.sources.iter().for_each(|source| source.describe(writer));
        for tap in &mut self.taps {
            tap.sampler.begin();
            tap.open_channel(writer);
        }
    }

    /// Subscribes to what modules offer that run by now. Nobody is waited for. `has_begun`: there is a time at which
    /// something can be recorded; before, what is recorded from its oldest record on stays in its ring.
    pub(super) fn find(
        &mut self,
        context: &mut Context,
        writer: &mut Writer,
        has_begun: bool,
    ) -> Result<(), ModuleError> {
        let node = context.link().borrow().participant().node().clone();
        for source in self.sources.iter_mut().filter(|source| source.description.is_none()) {
            let description = match source.own {
                Some(host) if runs(&node, host) => noted(&node, source.from),
                Some(_) => None,
                // With a replica comes the description, unless that is too long.
                None => noted(&node, source.from).or_else(|| source.asking.poll(context, source.from)),
            };
            let Some(description) = description else { continue };
            let mut taps = source.taps(&self.recording, &description);
            source.description = Some(description);
            source.describe(writer);
            taps.iter_mut().for_each(|tap| tap.open_channel(writer));
            self.taps.extend(taps);
        }
        let names_long = !self.recording.exact.is_empty();
        let opens = |tap: &&mut Tap| tap.source.is_none() && (has_begun || !names_long || !tap.is_whole(context));
        let opening: Vec<&mut Tap> = self.taps.iter_mut().filter(opens).collect();
        opening.into_iter().try_for_each(|tap| tap.open(context, &self.earlier, names_long))
    }

    /// Nothing waits to be taken, or soon will not.
    pub(super) fn begin_pace(&mut self) {
        self.blame.begin_pace();
    }

    /// Records a value that came, if it is to be.
    pub(super) fn take(&mut self, writer: &mut Writer, context: &Context, data: &Received<'_>) {
        let Self { taps, blame, .. } = self;
        let Some(tap) = taps.iter_mut().find(|tap| tap.has_brought(data)) else { return };
        let Some(channel) = tap.channel else { return };
        let (lost, is_chosen) = tap.sampler.note(&data.head, data.missed(), Instant::now());
        if lost != Lost::default() {
            blame
                .causes(lost, tap.omitted(), || mailbox_losses(context))
                .into_iter()
                .for_each(|(cause, count)| writer.count_lost(channel, cause, count));
        }
        tap.is_resumed = false;
        if !is_chosen || !tap.is_important(data) {
            return;
        }
        let message = message(&context.now(), data);
        // What is refused is counted; that the queue is full, tells `Health` with the reason.
        if let Err(error @ WriteError::Long(_)) = writer.write(channel, &message)
            && tap.refusal.is_empty()
        {
            tap.refusal = error.to_string();
            tracing::error!("{}/{}: {}", tap.module, tap.item.field.name, tap.refusal);
        }
    }
}

impl Taps {
    /// Notes a value that comes while nothing is recorded: it is no loss. The next recording may begin with it.
    pub(super) fn pass_over(&mut self, earlier: Option<&mut Earlier>, now: &SystemTime, data: &Received<'_>) {
        let Some(tap) = self.taps.iter_mut().find(|tap| tap.has_brought(data)) else { return };
        let (_, is_chosen) = tap.sampler.note(&data.head, data.missed(), Instant::now());
        if let (true, Some(channel), Some(earlier)) = (is_chosen, tap.channel, earlier) {
            earlier.note(channel, &message(now, data));
        }
    }
}

impl SourceModule {
    /// What it offers is said in each file, so that replay can stand in for it.
    fn describe(&self, writer: &mut Writer) {
        let Some(description) = &self.description else { return };
        if let Err(error) = writer.describe(&self.name, description) {
            tracing::error!("{error}");
        }
    }

    /// What is to be recorded of what the module offers.
    fn taps(&self, recording: &Recording, description: &Description) -> Vec<Tap> {
        let has = |items: &&RecordedItems, is_stream: bool| {
            let Some(wanted) = items.item.as_ref().filter(|_| items.from == Some(self.from)) else { return true };
            description.data_item(wanted).is_some_and(|item| !is_stream || item.kind == DataKind::Stream)
        };
        let missing = recording.streams.iter().filter(|items| !has(items, true)).map(|items| ("stream", items));
        let missing =
            missing.chain(recording.data.iter().filter(|items| !has(items, false)).map(|items| ("data", items)));
        for (what, items) in missing {
            let (name, wanted) = (&self.name, items.item.as_deref().unwrap_or_default());
            let known: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
            tracing::warn!(
                "{name} has no {what} `{wanted}` to record; of streams and data it has: {}",
                known.join(", ")
            );
        }
        let taps = description.data.iter().filter_map(|item| self.tap(recording, description, item));
        taps.chain(recording.is_exact(self.from).then(|| self.journal(description))).collect()
    }

    /// The module's journal. It is none of its interfaces: those do not know it.
    fn journal(&self, description: &Description) -> Tap {
        let text = "What the module is called with and told, and what it sends: for `rohrpost replay --exact`.";
        let field = Field::new(JOURNAL_NAME, Type::Bytes).said(text, "");
        let item = DataItem { number: JOURNAL_NUMBER, kind: DataKind::Stream, field };
        self.tap_of(&item, description, (Sampling::Each, Numbering::Records), None)
    }

    /// Whether this node has the stream: the module is its own, or there is a replica.
    fn is_here(&self, stream: &str) -> bool {
        self.own.is_some() || self.replicas.iter().any(|replica| replica == stream)
    }

    fn tap(&self, recording: &Recording, description: &Description, item: &DataItem) -> Option<Tap> {
        let name = &item.field.name;
        let is_stream = item.kind == DataKind::Stream;
        let is_line = description.class == CollectorInterface::CLASS && name == LINE;
        let ring = recording.in_place(self.from, name).filter(|_| is_stream && self.is_here(name));
        // `*` is not meant for streams, which may have records that fit no package.
        let named = |items: &&RecordedItems| !is_stream || items.item.is_some();
        let (sampling, numbering) = match (ring, recording.datum(self.from, name).filter(named)) {
            _ if is_line => recording.output.map(|_| (Sampling::Each, Numbering::Packages))?,
            (Some(items), _) => (items.sampling, Numbering::Records),
            (None, Some(items)) => (items.sampling, Numbering::Packages),
            (None, None) => return None,
        };
        let least = recording.output.filter(|_| is_line).map(|level| OutputLevel::ALL[level as usize]);
        Some(self.tap_of(item, description, (sampling, numbering), least))
    }

    fn tap_of(
        &self,
        item: &DataItem,
        description: &Description,
        (sampling, numbering): (Sampling, Numbering),
        least: Option<OutputLevel>,
    ) -> Tap {
        let interface = description.hash();
        let texts = [
            ("class", description.class.clone()),
            ("interface", format!("{interface:08x}")),
            ("number", item.number.to_string()),
            ("sampling", sampling.to_string()),
        ];
        Tap {
            from: self.from,
            module: self.name.clone(),
            item: item.clone(),
            interface,
            texts: texts.into_iter().map(|(key, text)| (key.to_owned(), text)).collect(),
            sampling,
            sampler: Sampler::new(sampling, numbering),
            is_near: self.own.is_some(),
            is_resumed: false,
            least,
            source: None,
            refusal: String::new(),
            channel: None,
        }
    }
}

impl Tap {
    /// Where it is recorded. A module that describes one name with two types is recorded without the second one.
    fn open_channel(&mut self, writer: &mut Writer) {
        let (name, item) = (&self.module, &self.item.field);
        let opened = writer.channel(&ChannelSpec { name, item: &item.name, ty: &item.ty, texts: self.texts.clone() });
        if let Err(error) = &opened {
            tracing::error!("{name}/{} is not recorded: {error}", item.name);
        }
        self.channel = opened.ok();
    }

    /// Subscribes. A stream that has no seat left is tried again. `names_long`: journals may name long records.
    fn open(&mut self, context: &mut Context, earlier: &EarlierFiles, names_long: bool) -> Result<(), ModuleError> {
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
    fn is_whole(&self, context: &Context) -> bool {
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
    fn omitted(&self) -> Omitted {
        match self.sampler.numbering() {
            Numbering::Records if self.is_resumed => Omitted::EarlierRecord,
            Numbering::Records => Omitted::Record,
            Numbering::Packages if self.is_near => Omitted::NearPackage,
            Numbering::Packages => Omitted::FarPackage,
        }
    }

    fn has_brought(&self, data: &Received<'_>) -> bool {
        match &self.source {
            Some(Source::Data(subscription)) => data.is_of(subscription),
            Some(Source::Stream(subscription)) => data.is_of(subscription),
            None => false,
        }
    }

    /// A line of output may be less important than those that are wanted. One that cannot be read is kept: it is what
    /// came.
    fn is_important(&self, data: &Received<'_>) -> bool {
        let Some(least) = self.least else { return true };
        from_bytes::<OutputLine>(data.value).map_or(true, |line| line.level <= least)
    }
}

/// A value that came, as it is recorded.
fn message<'a>(now: &SystemTime, data: &Received<'a>) -> Message<'a> {
    let (epoch, stamp_ns) = match data.moment() {
        Moment::Stamp(stamp) => (stamp.epoch, stamp.ns),
        Moment::Ns(ns) => (now.epoch, ns),
    };
    Message { arrival_ns: now.ns, stamp_ns, epoch, sequence: data.head.sequence, data: data.value }
}

/// Whether the process of a module runs, and is not about to begin or to end: what it noted of itself is true then.
fn runs(node: &Node, host: Name) -> bool {
    let is_it = |state: Option<ModuleState>| matches!(state, Some(ModuleState::On | ModuleState::Off));
    node.participants().iter().any(|process| process.module == host && is_it(process.state))
}
