//! What the bridge draws of which module: wanted by the configuration, described by the module, drawn by a view.

use crate::blueprint::{Layout, Tab};
use crate::description_request::DescriptionRequest;
use crate::view::{Datum, View};
use crate::{Scene, views};
use rohrpost::description::noted;
use rohrpost::interface::Interface;
use rohrpost::interfaces::CollectorInterface;
use rohrpost::schema::{DataItem, Description};
use rohrpost::survey::node_of;
use rohrpost::{Context, ContextError, Name, Rate, Received, Subscription};
use rohrpost_config::Show;
use rohrpost_mailbox::{Node, local};
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
}

/// Data that are subscribed to.
struct Subject {
    from: Name,
    module: String,
    item: DataItem,
    subscription: Subscription<()>,
    /// Which view draws it.
    view: usize,
    /// Number that the next package should have.
    expected: u32,
    repair: Option<Repair>,
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
}

impl Subjects {
    /// What the configuration wants to be shown, and what modules say. `own` views are asked before those built in.
    pub(crate) fn new(own: Vec<Box<dyn View>>, context: &Context) -> Self {
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
        ];
        let told = told.iter().filter(|(_, is_there)| *is_there).map(|(data, _)| *data);
        for (router, data) in routers.flat_map(|router| told.clone().map(move |data| (router, data))) {
            let (module, data) = (text(router), Some(data.into()));
            entries.push(Entry { from: router, module, data, rate: None, answered: false, asking: None });
        }
        for client in installation.nodes.iter().filter_map(|node| installation.tcp_client_of(&node.name)) {
            let (module, data) = (text(client), Some("link".into()));
            entries.push(Entry { from: client, module, data, rate: None, answered: false, asking: None });
        }
        let views = own.into_iter().chain(views::built_in()).collect();
        Self { views, entries, subjects: Vec::new() }
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
                false => entry.asking.get_or_insert_default().poll(context, entry.from),
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
                let mailbox = if wish.each { local::DATA } else { NEWEST };
                let rate = entry.rate.unwrap_or(wish.rate);
                let interface = description.hash();
                let subscription = context.subscribe_untyped(mailbox, entry.from, item.number, interface, rate)?;
                let repair = self.views[view].repair(&description).filter(|_| wish.each);
                // It may have sent much before anybody listened.
                let repair = repair.map(|function| Repair { function, interface, wanted: true, asked: None });
                let (from, module) = (entry.from, entry.module.clone());
                self.subjects.push(Subject { from, module, item, subscription, view, expected: 0, repair });
            }
        }
        Ok(self.subjects.len() > before)
    }

    /// The tabs of all views that have something to draw, in the order of the views.
    pub(crate) fn layout(&self) -> Layout {
        let used = (0..self.views.len()).filter(|view| self.subjects.iter().any(|subject| subject.view == *view));
        let mut tabs: Vec<Tab> = Vec::new();
        for tab in used.flat_map(|view| self.views[view].tabs()) {
            if tabs.iter().all(|known| known.name() != tab.name()) {
                tabs.push(tab);
            }
        }
        Layout::new(tabs)
    }

    /// Draws what came, if somebody wants it.
    pub(crate) fn draw(&mut self, scene: &mut Scene, context: &Context, data: &Received<'_>) {
        let is_it = |subject: &&mut Subject| data.is_of(&subject.subscription);
        let Some(subject) = self.subjects.iter_mut().find(is_it) else { return };
        // A number left out is a package lost; the first, or one after a restart, is 0.
        if let Some(repair) = subject.repair.as_mut().filter(|_| data.head.sequence != subject.expected) {
            repair.wanted = true;
        }
        subject.expected = data.head.sequence.wrapping_add(1);
        scene.set_time(data.head.stamp_ns);
        let Subject { from, module, item, view, .. } = subject;
        let installation = context.installation();
        let datum = Datum { from: *from, module, item, installation, bytes: data.value };
        if let Err(error) = self.views[*view].draw(scene, &datum) {
            tracing::warn!("{error}");
        }
    }

    /// Nothing is known of what was sent before: all have to send everything once more.
    pub(crate) fn want_repair(&mut self) {
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
