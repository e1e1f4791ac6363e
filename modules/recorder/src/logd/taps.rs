//! What is recorded of which module: wanted by the configuration, described by the module, subscribed to.

use super::blame::{Blame, mailbox_losses};
use super::earlier::EarlierFiles;
use super::sampler::{Lost, Numbering, Sampler};
use super::tap::{Tap, message};
use rohrpost::common::OutputLevel;
use rohrpost::description::{DescriptionRequest, noted};
use rohrpost::interface::Interface;
use rohrpost::interfaces::CollectorInterface;
use rohrpost::schema::{DataItem, DataKind, Description, Field, Type};
use rohrpost::{Context, ModuleError, ModuleState, Name, Node, Received, SystemTime};
use rohrpost_config::{Installation, RecordedItems, Recording, Sampling};
use rohrpost_modules::journal::{JOURNAL_NAME, JOURNAL_NUMBER};
use rohrpost_recording::{Earlier, WriteError, Writer};
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
        blame.go_on(|| mailbox_losses(context));
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

    /// Notes a value that comes while nothing is recorded: it is no loss. The next recording may begin with it.
    pub(super) fn pass_over(&mut self, earlier: Option<&mut Earlier>, now: &SystemTime, data: &Received<'_>) {
        let Some(tap) = self.taps.iter_mut().find(|tap| tap.has_brought(data)) else { return };
        self.blame.pass_over();
        let (_, is_chosen) = tap.sampler.note(&data.head, data.missed(), Instant::now());
        tap.is_resumed = false;
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

/// Whether the process of a module runs, and is not about to begin or to end: what it noted of itself is true then.
fn runs(node: &Node, host: Name) -> bool {
    let is_it = |state: Option<ModuleState>| matches!(state, Some(ModuleState::On | ModuleState::Off));
    node.participants().iter().any(|process| process.module == host && is_it(process.state))
}
