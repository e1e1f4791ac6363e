//! The list `calls`: the modules that a module sends commands to.

use crate::directory::Directory;
use crate::reader::Item;
use rohrpost_mailbox::Name;

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

/// A list `calls`, read.
#[derive(Default)]
pub(crate) struct Calls {
    pub(crate) names: Vec<Name>,
    /// Line of each name.
    pub(crate) lines: Vec<usize>,
    /// The names with a reason.
    pub(crate) downwards: DownwardCalls,
}

impl Calls {
    pub(crate) fn read(list: &Item<'_>, directory: &Directory<'_>, what: &str) -> Self {
        let mut calls = Self::default();
        for item in list.list("[\"motor.0\"]").unwrap_or_default() {
            let Some((text, downwards)) = entry(&item, what) else { continue };
            match directory.find(text) {
                Ok(name) if calls.names.contains(&name) && name != Name::NONE => {
                    item.reader.report(item.line, format!("{what} names `{text}` twice in `calls`; drop one"));
                }
                Ok(name) => {
                    calls.names.push(name);
                    calls.lines.push(item.line);
                    calls.downwards.0.extend(downwards.map(|why| (name, why)));
                }
                Err(unknown) => item.reader.report(
                    item.line,
                    format!(
                        "{what} calls `{text}`, which no [[module]] defines; {}",
                        unknown.or("drop it from `calls`")
                    ),
                ),
            }
        }
        calls
    }
}

/// A name alone, or a table of a name and the reason why it may be there.
fn entry<'d>(item: &Item<'d>, what: &str) -> Option<(&'d str, Option<Downwards>)> {
    if !item.is_table() {
        return Some((item.text_of_list("motor.0")?, None));
    }
    let section = item.section(&format!("{what}, calls"))?;
    let to = section.required("to", "to = \"output.0\"").and_then(|item| item.text("output.0"));
    let subscribes = section.get("subscribes").and_then(|item| item.flag());
    let downwards = if subscribes == Some(true) {
        Downwards::Subscribes
    } else {
        let example = "a picture may wait for it";
        let although = section.required("although", &format!("although = \"{example}\""));
        // A reason that could not be read has its own message, and counts nevertheless.
        Downwards::Although(although.and_then(|item| item.text(example)).unwrap_or_default().into())
    };
    section.finish();
    Some((to?, Some(downwards)))
}
