//! Where system time comes from.

use crate::node::{self, Node, Reach};
use crate::reader::{Item, Section};
use crate::units::duration_text;
use std::time::Duration;

const INTERVAL: Duration = Duration::from_secs(1);
const INTERVAL_MIN: Duration = Duration::from_millis(10);
const INTERVAL_MAX: Duration = Duration::from_secs(60);

/// The source of system time, section `[time]`.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum TimeSource {
    /// The computer's own clock.
    #[default]
    Local,
    /// The clock of one node, which the routers distribute: the only source that several nodes can share.
    Master {
        /// Nodes that may be master, by their place in the file; the first that runs is. At least one.
        masters: Vec<u8>,
        /// Interval of synchronisation; with time slots, the cycle.
        interval: Duration,
    },
    /// The simulation; `speed` 2.0 lets time pass twice as fast.
    Simulation {
        /// Simulated seconds a second.
        speed: f64,
    },
    /// The records of a log that is being replayed.
    Log,
}

/// What happens when the computer's clock was set by a day or more, ahead or back, since system time began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ClockSetPolicy {
    /// System time goes on, and tools say so until somebody begins a new epoch.
    #[default]
    Tell,
    /// A new epoch begins at the computer's clock.
    NewEpoch,
}

impl ClockSetPolicy {
    const WORDS: [(&str, Self); 2] = [("tell", Self::Tell), ("new-epoch", Self::NewEpoch)];

    /// The key `when-set`.
    fn read(section: &Section<'_>, source: &TimeSource) -> Self {
        let Some(item) = section.get("when-set") else { return Self::default() };
        if matches!(source, TimeSource::Simulation { .. } | TimeSource::Log) {
            item.report(
                "`when-set` goes only with `source = \"local\"` or \"master\": a simulation and a log have a time of \
                 their own; drop it, or change the source",
            );
        }
        item.choice(&Self::WORDS).unwrap_or_default()
    }
}

impl TimeSource {
    /// Nodes that may be master, by their place in the file; the first that runs is. None if time is not from a node.
    pub fn masters(&self) -> &[u8] {
        match self {
            Self::Master { masters, .. } => masters,
            _ => &[],
        }
    }

    /// `file` gives the line of a missing key; `nodes` are all of them; `cycle` is that of the time slots, if there are
    /// any.
    pub(crate) fn read(
        section: Option<Section<'_>>,
        file: &Section<'_>,
        nodes: &[Node],
        cycle: Option<Duration>,
    ) -> (Self, ClockSetPolicy) {
        let beyond = nodes.iter().find(|node| node.reach == Reach::Tcp);
        let nodes = node::on_lan(nodes);
        let several = nodes.len() > 1;
        let Some(section) = section else {
            if several {
                file.report(
                    "section `[time]` is missing; with several nodes one of them is the master of time: add `[time]` \
                     with `source = \"master\"`",
                );
            }
            return Default::default();
        };
        let master = Self::Master { masters: (0..).take(nodes.len()).collect(), interval: INTERVAL };
        let words = [
            ("local", Self::Local),
            ("master", master),
            ("simulation", Self::Simulation { speed: 1.0 }),
            ("log", Self::Log),
        ];
        let item = section.get("source");
        let mut source = item.as_ref().and_then(|item| item.choice(&words)).unwrap_or_default();
        let is_master = matches!(source, Self::Master { .. });
        match &item {
            Some(item) if is_master && nodes.len() == 1 => {
                item.report(
                    "`source` is \"master\", and there is one node on the LAN; write \"local\", or add the \
                             other nodes",
                );
            }
            Some(item) if several && !is_master => item.report(
                "`source`: with several nodes one of them is the master of time, and no other source reaches all of \
                 them; write `source = \"master\"`",
            ),
            None if several => section.report("`source` is missing; with several nodes write `source = \"master\"`"),
            Some(item) if matches!(source, Self::Simulation { .. } | Self::Log) => {
                if let Some(node) = beyond {
                    item.report(format!(
                        "`source`: the time of node `{}` comes by TCP, in which only clocks of computers can be told; \
                         write \"local\"",
                        node.name
                    ));
                }
            }
            _ => {}
        }
        if let Some(item) = section.get("speed") {
            match &mut source {
                Self::Simulation { speed } => *speed = item.number(0.01..=1000.0, "1.0").unwrap_or(1.0),
                _ => item.report("`speed` goes only with `source = \"simulation\"`; drop it, or change the source"),
            }
        }
        let (own_masters, own_interval) = (section.get("masters"), section.get("interval"));
        if let Self::Master { masters, interval } = &mut source {
            *masters = own_masters.map_or(masters.clone(), |item| read_masters(&item, nodes));
            *interval = match (cycle, own_interval) {
                (None, own) => own.and_then(|item| read_interval(&item)).unwrap_or(INTERVAL),
                (Some(cycle), None) => cycle,
                (Some(cycle), Some(own)) => {
                    own.report(format!(
                        "`interval`: with time slots the master synchronises once a cycle, {}, as `cycle` of [tdma] \
                         says; drop `interval`",
                        duration_text(cycle)
                    ));
                    cycle
                }
            };
        } else {
            for item in own_masters.into_iter().chain(own_interval) {
                item.report(format!(
                    "`{}` goes only with `source = \"master\"`; drop it, or change the source",
                    item.key
                ));
            }
        }
        let when_set = ClockSetPolicy::read(&section, &source);
        section.finish();
        (source, when_set)
    }

    /// The part that must be equal at both ends of the wire.
    pub(crate) fn lan_text(&self) -> String {
        match self {
            Self::Master { masters, interval } => format!("masters {masters:?} every {} ns", interval.as_nanos()),
            Self::Local | Self::Simulation { .. } | Self::Log => "-".into(),
        }
    }
}

fn read_masters(list: &Item<'_>, nodes: &[Node]) -> Vec<u8> {
    let mut masters: Vec<u8> = Vec::new();
    for (text, line) in list.texts("base") {
        let wrong = match node::place(nodes, text) {
            Ok(place) if !masters.contains(&place) => {
                masters.push(place);
                continue;
            }
            Ok(_) => format!("names `{text}` twice; drop one"),
            Err(missing) => missing,
        };
        list.reader.report(line, format!("[time]: `masters`: {wrong}"));
    }
    if masters.is_empty() && list.value.get_ref().as_array().is_some_and(|list| list.is_empty()) {
        list.report(
            "`masters` is empty; name the nodes that may be master, the first choice first, or drop it: then all may",
        );
    }
    masters
}

fn read_interval(item: &Item<'_>) -> Option<Duration> {
    let interval = item.duration("1 s")?;
    if (INTERVAL_MIN..=INTERVAL_MAX).contains(&interval) {
        return Some(interval);
    }
    item.report("`interval` is from \"10 ms\" to \"60 s\"; write for example `interval = \"1 s\"`");
    None
}
