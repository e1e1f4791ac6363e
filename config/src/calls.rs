//! The list `calls`: the modules that a module sends commands to.

use crate::directory::Directory;
use crate::reader::Item;
use rohrpost_mailbox::Name;

/// A list `calls`, read.
#[derive(Default)]
pub(crate) struct Calls {
    pub(crate) names: Vec<Name>,
    /// Line of each name.
    pub(crate) lines: Vec<usize>,
    /// The names with a reason, and the reason.
    pub(crate) although: Vec<(Name, String)>,
}

impl Calls {
    pub(crate) fn read(list: &Item<'_>, directory: &Directory<'_>, what: &str) -> Self {
        let mut calls = Self::default();
        for item in list.list("[\"motor.0\"]").unwrap_or_default() {
            let Some((text, although)) = entry(&item, what) else { continue };
            match directory.find(text) {
                Ok(name) if calls.names.contains(&name) && name != Name::NONE => {
                    item.reader.report(item.line, format!("{what} names `{text}` twice in `calls`; drop one"));
                }
                Ok(name) => {
                    calls.names.push(name);
                    calls.lines.push(item.line);
                    calls.although.extend(although.map(|why| (name, why.into())));
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

/// A name alone, or a table of a name and the reason why it may be called.
fn entry<'d>(item: &Item<'d>, what: &str) -> Option<(&'d str, Option<&'d str>)> {
    if !item.is_table() {
        return Some((item.text_of_list("motor.0")?, None));
    }
    let section = item.section(&format!("{what}, calls"))?;
    let to = section.required("to", "to = \"output.0\"").and_then(|item| item.text("output.0"));
    let example = "a picture may wait for it";
    let although = section.required("although", &format!("although = \"{example}\""));
    let although = although.and_then(|item| item.text(example));
    section.finish();
    // A reason that could not be read has its own message, and counts nevertheless.
    Some((to?, Some(although.unwrap_or_default())))
}
