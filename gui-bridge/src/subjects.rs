//! What the bridge draws of which module: wanted by the configuration, described by the module, drawn by a view.

use crate::blueprint::Layout;
use crate::ring::Ring;
use crate::team::Floor;
use crate::view::{Datum, View, Wish};
use crate::{Scene, replicas, views};
use rerun::EntityPath;
use rohrpost::common::DataHead;
use rohrpost::description::{DescriptionRequest, noted};
use rohrpost::interface::Interface;
use rohrpost::interfaces::CollectorInterface;
use rohrpost::schema::{DataItem, DataKind, Description};
use rohrpost::{Context, ContextError, Name, Rate, Received, Subscription};
use rohrpost_config::{Installation, Show};
use rohrpost_launch::survey::node_of;
use rohrpost_mailbox::{BODY_BYTES_MAX, Node, local};
use std::time::{Duration, Instant};

/// The mailbox for what tells how things are now: while the bridge stands still, a newer package takes an older one's
/// place. Its data mailbox has all that must come in order and without gaps.
pub(crate) const NEWEST: u8 = 3;
/// A module is asked at most so often to send everything once more.
const REPAIR: Duration = Duration::from_secs(5);

/// One of `[gui] show`.
struct Entry {
    from: Name,
    module: String,
    /// None: all that its module has a view for.
    data: Option<String>,
    rate: Option<Rate>,
    /// Its module has described itself.
    answered: bool,
    /// It is on another node, and being asked.
    asking: Option<DescriptionRequest>,
    /// What it has answered; [`Subjects::find`] takes it.
    heard: Option<Description>,
}

/// Data that are drawn.
struct Subject {
    from: Name,
    module: String,
    item: DataItem,
    source: Source,
    /// Which view draws it.
    view: usize,
    /// Number that the next package should have.
    expected: u32,
    repair: Option<Repair>,
}

/// How data come to the bridge.
enum Source {
    /// As packages, near and far alike.
    Data(Subscription<()>),
    /// From a stream of this node with records that do not fit into the bridge's mailbox. What fits comes as packages,
    /// also from a stream: it comes so from each node, costs none of the stream's seats, and a bridge that is asleep is
    /// woken for it.
    Ring(Box<Ring>),
    /// From a replica of this node, whatever its size: packages would be on the network besides. And where its delay
    /// is drawn.
    Replica(Box<Ring>, EntityPath),
}

/// What the bridge has for what comes.
#[derive(Clone, Copy)]
pub(crate) struct Intake {
    /// Longest body that its mailboxes for data take.
    pub(crate) body_bytes_max: usize,
    /// Least time between two drawings of the same.
    pub(crate) period: Duration,
}

/// How to ask for everything once more.
struct Repair {
    function: u16,
    interface: u32,
    wanted: bool,
    asked: Option<Instant>,
}

/// See the module's text.
pub(crate) struct Subjects {
    views: Vec<Box<dyn View>>,
    entries: Vec<Entry>,
    subjects: Vec<Subject>,
    intake: Intake,
}

impl Subjects {
    /// What the configuration wants to be shown, and what modules say. `own` views are asked before those built in.
    pub(crate) fn new(own: Vec<Box<dyn View>>, floor: Option<Floor>, context: &Context, intake: Intake) -> Self {
        let installation = context.installation();
        let text = |name| installation.classes.format(name);
        let entry = |show: &Show| Entry {
            from: show.from,
            module: text(show.from),
            data: show.data.clone(),
            // Configuration has looked at it: 0 to 1000.
            rate: show.rate.and_then(|rate_hz| Rate::hz(rate_hz).ok()),
            answered: false,
            asking: None,
            heard: None,
        };
        let mut entries: Vec<Entry> = installation.gui.show.iter().map(entry).collect();
        if let Some(class) = installation.classes.id(CollectorInterface::CLASS) {
            let from = Name::new(installation.system.id, class.0, 0, 0);
            if installation.module(from).is_some() {
                entries.push(Entry {
                    from,
                    module: text(from),
                    data: Some("line".into()),
                    rate: None,
                    answered: false,
                    asking: None,
                    heard: None,
                });
            }
        }
        // With one node there are none.
        let routers = installation.nodes.iter().filter_map(|node| installation.router_of(&node.name));
        let told = [
            ("links", true),
            ("clock", true),
            ("slots", installation.tdma.is_some()),
            ("flows", !installation.flows.is_empty()),
            ("replicas", !installation.replicas.is_empty()),
        ];
        let told = told.iter().filter(|(_, is_there)| *is_there).map(|(data, _)| *data);
        for (router, data) in routers.flat_map(|router| told.clone().map(move |data| (router, data))) {
            let (module, data) = (text(router), Some(data.into()));
            entries.push(Entry { from: router, module, data, rate: None, answered: false, asking: None, heard: None });
        }
        for client in installation.nodes.iter().filter_map(|node| installation.tcp_client_of(&node.name)) {
            let (module, data) = (text(client), Some("link".into()));
            entries.push(Entry { from: client, module, data, rate: None, answered: false, asking: None, heard: None });
        }
        let views = own.into_iter().chain(views::built_in(floor)).collect();
        Self { views, entries, subjects: Vec::new(), intake }
    }

    /// Takes what modules of other nodes have answered, and asks at once for their next parts: a long description has
    /// many, and a second's half between two of them is many seconds without a picture.
    pub(crate) fn collect(&mut self, context: &Context) {
        for entry in &mut self.entries {
            let asking = entry.asking.as_mut().filter(|asking| asking.is_under_way());
            if let Some(description) = asking.and_then(|asking| asking.poll(context, entry.from)) {
                (entry.asking, entry.heard) = (None, Some(description));
            }
        }
    }

    /// Reads the descriptions that are missing of modules that run, and subscribes to what they tell; whether there is
    /// more than before. Modules note their descriptions beside their mailboxes; those of other nodes are asked. Nobody
    /// is waited for.
    pub(crate) fn find(
        &mut self,
        context: &mut Context,
        node: &Node,
        own: &str,
        runs: impl Fn(Name) -> bool,
        mut found: impl FnMut(Name),
    ) -> Result<bool, ContextError> {
        let before = self.subjects.len();
        for entry in self.entries.iter_mut().filter(|entry| !entry.answered && runs(entry.from)) {
            let is_own = node_of(context.installation(), entry.from) == Some(own);
            let description = match is_own {
                true => noted(node, entry.from),
                false => entry.heard.take().or_else(|| entry.asking.get_or_insert_default().poll(context, entry.from)),
            };
            let Some(description) = description else { continue };
            (entry.answered, entry.asking) = (true, None);
            let items = entry.items(&description, &self.views);
            for item in items {
                let known = |subject: &Subject| subject.from == entry.from && subject.item.number == item.number;
                let Some(view) = self.views.iter().position(|view| view.wants(&description, &item)) else { continue };
                if self.subjects.iter().any(known) {
                    continue;
                }
                found(entry.from);
                let wish = self.views[view].wish();
                let wish = wish.at(entry.rate.unwrap_or(wish.rate));
                let interface = description.hash();
                let source = match way(context.installation(), own, entry.from, &item, wish, self.intake) {
                    Way::Data => {
                        let mailbox = if wish.each { local::DATA } else { NEWEST };
                        let (from, number) = (entry.from, item.number);
                        Source::Data(context.subscribe_untyped(mailbox, from, number, interface, wish.rate)?)
                    }
                    Way::Ring => Source::Ring(Box::new(Ring::new(interface, self.intake.period_of(wish.rate)))),
                    Way::Replica { delay } => {
                        Source::Replica(Box::new(Ring::new(interface, self.intake.period_of(wish.rate))), delay)
                    }
                    Way::Unseen { why } => {
                        tracing::warn!("{why}");
                        continue;
                    }
                };
                let repair = self.views[view].repair(&description).filter(|_| wish.each);
                // It may have sent much before anybody listened.
                let repair = repair.map(|function| Repair { function, interface, wanted: true, asked: None });
                let (from, module) = (entry.from, entry.module.clone());
                self.subjects.push(Subject { from, module, item, source, view, expected: 0, repair });
            }
        }
        Ok(self.subjects.len() > before)
    }

    /// The tabs of all views that have something to draw, in the order of the views.
    pub(crate) fn layout(&self) -> Layout {
        let subjects = |view: usize| self.subjects.iter().filter(move |subject| subject.view == view);
        let used = (0..self.views.len()).filter(|view| subjects(*view).next().is_some());
        let own = (0..self.views.len()).flat_map(subjects);
        let own = own.filter_map(|of| {
            let tab = self.views[of.view].tab_of(&of.module, &of.item)?;
            let Source::Replica(_, delay) = &of.source else { return Some(tab) };
            let (module, item) = (&of.module, &of.item.field.name);
            Some(tab.over_curves(format!("{module} {item}, by a replica"), "Delay, ms".into(), delay.clone()))
        });
        Layout::new(used.flat_map(|view| self.views[view].tabs()).chain(own).collect())
    }

    /// Draws what came, if somebody wants it.
    pub(crate) fn draw(&mut self, scene: &mut Scene, context: &Context, data: &Received<'_>) {
        let is_it = |subject: &&mut Subject| matches!(&subject.source, Source::Data(of) if data.is_of(of));
        let Some(subject) = self.subjects.iter_mut().find(is_it) else { return };
        // A number left out is a package lost; the first, or one after a restart, is 0.
        if let Some(repair) = subject.repair.as_mut().filter(|_| data.head.sequence != subject.expected) {
            repair.wanted = true;
        }
        subject.expected = data.head.sequence.wrapping_add(1);
        let Subject { from, module, item, view, .. } = subject;
        let installation = context.installation();
        let datum = Datum { from: *from, module, item, installation, bytes: data.value };
        // Another system's time may be any.
        let is_own = from.system() == installation.system.id;
        let at_ns = if is_own { data.head.stamp_ns } else { context.now().ns };
        draw(self.views[*view].as_mut(), scene, at_ns, &datum);
    }

    /// Whether there are streams to look at.
    pub(crate) fn have_rings(&self) -> bool {
        self.subjects.iter().any(|subject| !matches!(subject.source, Source::Data(_)))
    }

    /// Draws what is new in streams that are due.
    pub(crate) fn look(&mut self, scene: &mut Scene, context: &mut Context) {
        let (now, views) = (Instant::now(), &mut self.views);
        for Subject { from, module, item, source, view, .. } in &mut self.subjects {
            let Some(ring) = source.ring() else { continue };
            if !ring.is_due(context, *from, item, now) {
                continue;
            }
            let installation = context.installation();
            ring.look(|stamp_ns, bytes| {
                let datum = Datum { from: *from, module, item, installation, bytes };
                draw(views[*view].as_mut(), scene, stamp_ns, &datum);
            });
        }
    }

    /// Nothing is known of what was sent before: all have to send everything once more, and streams are read again.
    pub(crate) fn want_repair(&mut self) {
        for subject in &mut self.subjects {
            if let Some(ring) = subject.source.ring() {
                ring.forget();
            }
        }
        for repair in self.subjects.iter_mut().filter_map(|subject| subject.repair.as_mut()) {
            (repair.wanted, repair.asked) = (true, None);
        }
    }

    /// Asks modules that lost a part on the way to send everything again. Does not wait.
    pub(crate) fn repair(&mut self, context: &Context) {
        for subject in &mut self.subjects {
            let Some(repair) = subject.repair.as_mut().filter(|repair| repair.wanted) else { continue };
            if repair.asked.is_some_and(|asked| asked.elapsed() < REPAIR) {
                continue;
            }
            (repair.wanted, repair.asked) = (false, Some(Instant::now()));
            let mut link = context.link().borrow_mut();
            match link.begin(subject.from, repair.function, repair.interface, REPAIR, |_| Ok(())) {
                Ok(call) => link.forget(call),
                Err(error) => tracing::debug!("{} does not send everything once more: {error}", subject.module),
            }
        }
    }
}

fn draw(view: &mut dyn View, scene: &mut Scene, stamp_ns: u64, datum: &Datum<'_>) {
    scene.set_time(stamp_ns);
    if let Err(error) = view.draw(scene, datum) {
        tracing::warn!("{error}");
    }
}

impl Source {
    fn ring(&mut self) -> Option<&mut Ring> {
        match self {
            Self::Data(_) => None,
            Self::Ring(ring) | Self::Replica(ring, _) => Some(ring),
        }
    }
}

impl Intake {
    /// Least time between two looks at a stream that is wanted so often.
    fn period_of(self, rate: Rate) -> Duration {
        match rate {
            Rate::Each => self.period,
            Rate::Every(period) => period.max(self.period),
        }
    }
}

/// How a datum can come.
#[derive(Debug, PartialEq)]
enum Way {
    Data,
    Ring,
    Replica {
        /// Where its delay is drawn.
        delay: EntityPath,
    },
    Unseen {
        /// What to do about it.
        why: String,
    },
}

/// How this datum comes to a bridge on the node `own`. What a view wants each of comes as packages: they are counted
/// and asked for once more.
fn way(installation: &Installation, own: &str, from: Name, item: &DataItem, wish: Wish, intake: Intake) -> Way {
    let (stream, node) = (&item.field.name, node_of(installation, from));
    if item.kind == DataKind::Data || wish.each {
        return Way::Data;
    }
    if let Some(replica) = installation.replica_on(own, from, stream) {
        let delay = replicas::delay_of(&replica.text(installation), [node.unwrap_or("?"), own]);
        return Way::Replica { delay };
    }
    let spec = installation.module(from).and_then(|module| module.streams.get(stream));
    let record_bytes = spec.copied().unwrap_or_default().record_bytes as usize;
    let is_own = node == Some(own);
    if DataHead::BYTES + record_bytes <= if is_own { intake.body_bytes_max } else { BODY_BYTES_MAX } {
        return Way::Data;
    }
    if is_own {
        return Way::Ring;
    }
    let (module, node, most) =
        (installation.classes.format(from), node.unwrap_or("?"), BODY_BYTES_MAX - DataHead::BYTES);
    let remedy = installation.replica_remedy(own, from, stream);
    let why = format!(
        "stream `{stream}` of {module} is not shown: it is on node `{node}`, and its records of up to {record_bytes} \
         bytes fit no package; {remedy}, or lower `record` in [module.stream.{stream}] of {module} to {most} if its \
         values have no more"
    );
    Way::Unseen { why }
}

impl Entry {
    /// The data of a module that are wanted; those that only the last view, which wants all, would draw are not worth
    /// it unless they are all that there is.
    fn items(&self, description: &Description, views: &[Box<dyn View>]) -> Vec<DataItem> {
        let Some(name) = &self.data else {
            let special = &views[..views.len().saturating_sub(1)];
            let known = |item: &&DataItem| special.iter().any(|view| view.wants(description, item));
            let items: Vec<DataItem> = description.data.iter().filter(known).cloned().collect();
            return if items.is_empty() { description.data.clone() } else { items };
        };
        let item = description.data_item(name).cloned();
        if item.is_none() {
            let names: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
            tracing::warn!("{} has no data `{name}` to draw; it has: {}", self.module, names.join(", "));
        }
        item.into_iter().collect()
    }
}

#[cfg(test)]
mod tests;
