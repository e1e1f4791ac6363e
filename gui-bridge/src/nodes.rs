//! What runs on all nodes. The own node is read directly; launch reports the others. Nothing here waits.

use rohrpost::{Class, Context, Name};
use rohrpost_config::Installation;
use rohrpost_launch::launcher::{SnapshotRequest, launcher_of};
use rohrpost_launch::survey::{Distant, Scope, Snapshot, Survey};
use rohrpost_mailbox::{Latency, Node, NodeError, local};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

/// A launch shows its node within this time, or the node is silent.
const PATIENCE: Duration = Duration::from_secs(1);

/// See the module's text.
pub(crate) struct Nodes {
    node: Arc<Node>,
    own: NodeSurveys,
    others: Vec<RemoteNode>,
}

/// Shortest time between two surveys that give a rate. A few packages in a few milliseconds would be thousands a
/// second, and flatten the rest of the curve.
pub(crate) const RATE_INTERVAL_MIN: Duration = Duration::from_millis(250);

/// A node other than the own one.
struct RemoteNode {
    looks: NodeSurveys,
    launcher: Name,
    look: Option<Distant>,
    silent: bool,
}

/// The last two surveys of a node.
struct NodeSurveys {
    node: String,
    earlier: Option<Survey>,
    now: Option<Survey>,
}

/// What the packages of a class did, on all nodes.
#[derive(Default)]
pub(crate) struct ClassFigures {
    /// Received a second where they were to go.
    pub(crate) received_per_s: f64,
    pub(crate) lost: u64,
    /// Until they were taken by those that they were for.
    pub(crate) at_end: Latency,
    /// Until the router of their sender's node took them.
    pub(crate) in_transit: Latency,
}

impl NodeSurveys {
    fn of(node: &str) -> Self {
        Self { node: node.into(), earlier: None, now: None }
    }

    fn take(&mut self, survey: Survey) {
        let is_apart = |now: &Survey| survey.at_ns.saturating_sub(now.at_ns) >= RATE_INTERVAL_MIN.as_nanos() as u64;
        if self.now.as_ref().is_some_and(is_apart) {
            self.earlier = self.now.take();
        }
        self.now = Some(survey);
    }
}

impl Nodes {
    /// Those of this installation, seen from this one.
    pub(crate) fn new(node: Arc<Node>, name: &str, installation: &Installation) -> Self {
        let other = |config: &rohrpost_config::Node| {
            let launcher = launcher_of(installation, &config.name)?;
            Some(RemoteNode { looks: NodeSurveys::of(&config.name), launcher, look: None, silent: true })
        };
        let others = installation.nodes.iter().filter(|config| config.name != name).filter_map(other).collect();
        Self { node, own: NodeSurveys::of(name), others }
    }

    /// NodeSurveys anew: at the own node at once, and asks for the others, which [`Nodes::collect`] takes.
    pub(crate) fn look(&mut self, context: &Context) -> Result<(), NodeError> {
        self.own.take(Survey::new(&self.node, context.installation(), &self.own.node)?);
        let count = self.others.len();
        for other in &mut self.others {
            let what = SnapshotRequest::Survey(Scope::Mailboxes);
            other.look.get_or_insert_with(|| Distant::new(other.launcher, what, PATIENCE, count));
        }
        self.collect(context);
        Ok(())
    }

    /// Takes what has come of other nodes, and asks for what is missing.
    pub(crate) fn collect(&mut self, context: &Context) {
        let mut link = context.link().borrow_mut();
        for other in &mut self.others {
            let Some(seen) = other.look.as_mut().and_then(|look| look.poll(&mut link)) else { continue };
            other.look = None;
            other.silent = true;
            if let Ok(Snapshot::Survey(survey)) = seen {
                other.looks.take(*survey);
                other.silent = false;
            }
        }
    }

    /// Whether there are others.
    pub(crate) fn are_several(&self) -> bool {
        !self.others.is_empty()
    }

    /// All nodes as one; of those that are silent, the modules that they should have.
    pub(crate) fn survey(&self, installation: &Installation) -> Survey {
        let (silent, heard): (Vec<&RemoteNode>, Vec<&RemoteNode>) = self.others.iter().partition(|other| other.silent);
        let silent: Vec<&str> = silent.iter().map(|other| other.looks.node.as_str()).collect();
        let seen = self.own.now.iter().chain(heard.iter().filter_map(|other| other.looks.now.as_ref()));
        Survey::joined(seen.cloned().collect(), &silent, installation)
    }

    /// What each class did between the last two looks; none before there were two.
    pub(crate) fn figures(&self, router: Option<Class>) -> BTreeMap<Option<Class>, ClassFigures> {
        let mut figures: BTreeMap<Option<Class>, ClassFigures> = BTreeMap::new();
        let all = self.others.iter().filter(|other| !other.silent).map(|other| &other.looks).chain([&self.own]);
        for (earlier, now) in all.filter_map(|looks| looks.earlier.as_ref().zip(looks.now.as_ref())) {
            let seconds = now.at_ns.saturating_sub(earlier.at_ns) as f64 / 1e9;
            for class in &now.classes {
                let before = earlier.classes.iter().find(|known| known.class == class.class);
                let entry = figures.entry(class.class).or_default();
                let received = class.received.saturating_sub(before.map_or(0, |before| before.received));
                entry.received_per_s += if seconds > 0.0 { received as f64 / seconds } else { 0.0 };
                entry.lost = entry.lost.saturating_add(class.lost_in_all());
                entry.at_end.add(&before.map_or(class.latency.clone(), |before| class.latency.since(&before.latency)));
            }
            let is_transit = |name: Name| Some(name.class()) == router && name.local() == local::TRANSIT;
            for mailbox in now.mailboxes.iter().filter(|mailbox| is_transit(mailbox.name)) {
                let before = earlier.mailboxes.iter().find(|known| known.name == mailbox.name);
                for class in &mailbox.classes {
                    let before =
                        before.and_then(|before| before.classes.iter().find(|known| known.class == class.class));
                    let waited = before.map_or(class.latency.clone(), |before| class.latency.since(&before.latency));
                    figures.entry(class.class).or_default().in_transit.add(&waited);
                }
            }
        }
        figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(at_ms: u64) -> Survey {
        let (modules, mailboxes, classes, flows) = Default::default();
        Survey {
            node: "main".into(),
            at_ns: at_ms * 1_000_000,
            modules,
            mailboxes,
            streams: Vec::new(),
            classes,
            flows,
        }
    }

    #[test]
    fn no_rate_is_made_of_surveys_that_follow_each_other_at_once() {
        let mut looks = NodeSurveys::of("main");
        let apart_ms = RATE_INTERVAL_MIN.as_millis() as u64;
        for (at_ms, between_ms, why) in [
            (1000, None, "one look alone"),
            (1003, None, "the second follows at once"),
            (1003 + apart_ms, Some(apart_ms), "far enough"),
            (1010 + apart_ms, Some(apart_ms + 7), "too close to the last, so from the one before it"),
            (1510 + apart_ms, Some(500), "and on"),
        ] {
            looks.take(look(at_ms));
            let both = looks.earlier.as_ref().zip(looks.now.as_ref());
            assert_eq!(both.map(|(earlier, now)| (now.at_ns - earlier.at_ns) / 1_000_000), between_ms, "{why}");
        }
    }
}
