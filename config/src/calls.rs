//! The list `calls`: the modules that a module sends commands to.

use crate::directory::Directory;
use crate::reader::Item;
use rohrpost_mailbox::Name;
use std::time::Duration;

/// How long a proxy waits for an answer, unless its program or the file says otherwise.
pub const CALL_TIMEOUT: Duration = Duration::from_secs(1);

/// Why a module names a less important one in its `calls`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Downwards {
    /// Only subscribes to the other's data, and calls nothing: that waits for nobody.
    Subscribes,
    /// The file's reason.
    Although(String),
}

/// The names of a list `calls` that may have a less important class, each with the reason.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DownwardCalls(Vec<(Name, Downwards)>);

impl DownwardCalls {
    /// Why this name may have a less important class.
    pub fn why(&self, to: Name) -> Option<&Downwards> {
        self.0.iter().find(|(name, _)| *name == to).map(|(_, why)| why)
    }

    /// Whether the name is there for subscriptions alone.
    pub fn subscribes(&self, to: Name) -> bool {
        self.why(to) == Some(&Downwards::Subscribes)
    }
}

/// How long a module waits at most for an answer, for the names of its `calls` that say so.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CallLimits(Vec<(Name, Duration)>);

impl CallLimits {
    /// Longest wait for an answer of this module; none: as long as the program says.
    pub fn of(&self, to: Name) -> Option<Duration> {
        self.0.iter().find(|(name, _)| *name == to).map(|(_, limit)| *limit)
    }
}

/// A list `calls`, read.
#[derive(Default)]
pub(crate) struct Calls {
    pub(crate) names: Vec<Name>,
    /// Line of each name.
    pub(crate) lines: Vec<usize>,
    /// The names that nobody else may command, with their line.
    pub(crate) alone: Vec<(Name, usize)>,
    /// The names with a reason.
    pub(crate) downwards: DownwardCalls,
    /// The names with a longest wait.
    pub(crate) limits: CallLimits,
    /// Which name it may wait for longest, and how long, as far as the file knows.
    pub(crate) longest: Option<(String, Duration)>,
}

/// An entry of the list, read.
struct Entry<'d> {
    to: &'d str,
    downwards: Option<Downwards>,
    limit: Option<Duration>,
    is_alone: bool,
}

impl Calls {
    pub(crate) fn read(list: &Item<'_>, directory: &Directory<'_>, what: &str) -> Self {
        let mut calls = Self::default();
        for item in list.list("[\"motor.0\"]").unwrap_or_default() {
            let Some(Entry { to, downwards, limit, is_alone }) = entry(&item, what) else { continue };
            match directory.find(to).or_else(|unknown| directory.elsewhere(to).ok_or(unknown)) {
                Ok(name) if calls.names.contains(&name) && name != Name::NONE => {
                    item.reader.report(item.line, format!("{what} names `{to}` twice in `calls`; drop one"));
                }
                Ok(name) => {
                    calls.names.push(name);
                    calls.lines.push(item.line);
                    if downwards != Some(Downwards::Subscribes) {
                        calls.may_wait(to, limit.unwrap_or(CALL_TIMEOUT));
                    }
                    calls.downwards.0.extend(downwards.map(|why| (name, why)));
                    calls.alone.extend(is_alone.then_some((name, item.line)));
                    calls.limits.0.extend(limit.map(|limit| (name, limit)));
                }
                Err(unknown) => item.reader.report(
                    item.line,
                    format!("{what} calls `{to}`, which no [[module]] defines; {}", unknown.or("drop it from `calls`")),
                ),
            }
        }
        calls
    }

    fn may_wait(&mut self, to: &str, time: Duration) {
        if self.longest.as_ref().is_none_or(|(_, longest)| time > *longest) {
            self.longest = Some((to.into(), time));
        }
    }
}

/// A name alone, or a table of a name and what is special about it.
fn entry<'d>(item: &Item<'d>, what: &str) -> Option<Entry<'d>> {
    if !item.is_table() {
        return Some(Entry { to: item.text_of_list("motor.0")?, downwards: None, limit: None, is_alone: false });
    }
    let section = item.section(&format!("{what}, calls"))?;
    let to = section.required("to", "to = \"output.0\"").and_then(|item| item.text("output.0"));
    let subscribes = section.get("subscribes").and_then(|item| item.flag()) == Some(true);
    let within = section.get("within");
    let alone = section.get("alone");
    let is_alone = alone.as_ref().and_then(Item::flag) == Some(true);
    if let Some(alone) = alone.filter(|_| is_alone && subscribes) {
        alone.report("`alone` is of no use beside `subscribes = true`, which commands nothing; drop one of them");
    }
    let example = "a picture may wait for it";
    let downwards = match &within {
        Some(within) if subscribes => {
            within.report("`within` is of no use beside `subscribes = true`, which waits for nobody; drop one of them");
            Some(Downwards::Subscribes)
        }
        None if subscribes => Some(Downwards::Subscribes),
        // A reason that could not be read has its own message, and counts nevertheless.
        _ if within.is_some() || is_alone => section.get("although").map(|item| reason(&item, example)),
        _ => {
            let although = section.required("although", &format!("although = \"{example}\""));
            Some(although.map_or(Downwards::Although(String::new()), |item| reason(&item, example)))
        }
    };
    let limit = within.and_then(|item| item.duration_above_zero("200 ms"));
    section.finish();
    Some(Entry { to: to?, downwards, limit, is_alone })
}

fn reason(although: &Item<'_>, example: &str) -> Downwards {
    Downwards::Although(although.text(example).unwrap_or_default().into())
}
