//! What a module sends and says, as its journal has it.

use super::entry::VERSION;
use super::event::JournalEvent;
use super::question::Question;
use super::records::NamedRecord;
use super::tag::Tag;
use super::value::{NotedValue, in_hex};
use rohrpost_mailbox::Name;
use rohrpost_schema::{Description, Type, decode};
use serde::{Deserialize, Serialize};

/// What a program knows of types: to show values.
#[derive(Default)]
pub(super) struct KnownTypes {
    /// Its own interfaces, under each of its names.
    pub(super) own: Vec<Option<Description>>,
    /// Those that it calls, by their hashes.
    pub(super) called: Vec<(u32, Description)>,
}

/// How a journal begins: with all that the module was given at its start.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct Begin<'a> {
    pub(super) version: u32,
    /// The module's name, as the configuration has it.
    pub(super) module: &'a str,
    /// The configuration's file, and its text.
    pub(super) config: (&'a str, &'a str),
    /// The same of saved parameters, if the configuration has a place for them.
    pub(super) saved: Option<(&'a str, &'a str)>,
}

impl<'a> Begin<'a> {
    pub(crate) fn new(module: &'a str, config: (&'a str, &'a str), saved: Option<(&'a str, &'a str)>) -> Self {
        Self { version: VERSION, module, config, saved }
    }

    /// All but where files are.
    pub(super) fn texts(&self) -> (u32, &'a str, &'a str, Option<&'a str>) {
        (self.version, self.module, self.config.1, self.saved.map(|(_, text)| text))
    }
}

/// Data that were published, or a record that was written.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct NotedItem<'a> {
    /// Which of the module's names.
    pub(crate) endpoint: u16,
    pub(crate) number: u16,
    pub(crate) stamp_ns: u64,
    #[serde(borrow)]
    pub(crate) value: NotedValue<'a>,
}

/// A command that was sent.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct NotedCommand<'a> {
    pub(crate) to: u32,
    pub(crate) function: u16,
    pub(crate) interface: u32,
    pub(crate) timeout_ns: u64,
    #[serde(borrow)]
    pub(crate) arguments: NotedValue<'a>,
}

/// What a function of the module gave back: a result, or a fault.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct NotedReply<'a> {
    pub(crate) is_fault: bool,
    #[serde(borrow)]
    pub(crate) result: NotedValue<'a>,
}

/// An entry in words: what was sent, by its description. `event`: what the module was called with.
pub(super) fn describe(tag: Tag, content: &[u8], event: Option<&JournalEvent<'_>>, known: &KnownTypes) -> String {
    let text = match tag {
        Tag::Published | Tag::Written => postcard::from_bytes(content).ok().map(|its| published(&its, known)),
        Tag::Called => postcard::from_bytes(content).ok().map(|its| called(&its, known)),
        Tag::Replied => postcard::from_bytes(content).ok().map(|its| replied(&its, event, known)),
        Tag::Named => postcard::from_bytes(content).ok().map(|its: NamedRecord| its.to_string()),
        Tag::GaveOut => postcard::from_bytes(content).ok().map(|its: NotedValue<'_>| its.shown(|_| None)),
        Tag::Failed | Tag::Panicked => postcard::from_bytes::<&str>(content).ok().map(|text| format!("\"{text}\"")),
        _ => return asked(tag, content),
    };
    format!("it {}: {}", tag.words(), text.unwrap_or_else(|| in_hex(content)))
}

/// An entry with a question, in words.
fn asked(tag: Tag, content: &[u8]) -> String {
    let is_question = !matches!(tag, Tag::Begin | Tag::Event | Tag::Hole | Tag::End);
    let question = is_question.then(|| postcard::take_from_bytes::<Question<'_>>(content).ok()).flatten();
    match question.and_then(|(question, _)| question.words()) {
        Some(question) => format!("it {}: {question}", tag.words()),
        None => format!("it {}", tag.words()),
    }
}

impl KnownTypes {
    fn own(&self, endpoint: u16) -> Option<&Description> {
        self.own.get(usize::from(endpoint))?.as_ref()
    }
}

fn published(its: &NotedItem<'_>, known: &KnownTypes) -> String {
    let item = known.own(its.endpoint).and_then(|own| own.data.iter().find(|item| item.number == its.number));
    let value = its.value.shown(|bytes| Some(decode(&item?.field.ty, bytes).ok()?.to_string()));
    let name = item.map_or_else(|| its.number.to_string(), |item| item.field.name.clone());
    format!("{name} of {} ns, {value}", its.stamp_ns)
}

fn called(its: &NotedCommand<'_>, known: &KnownTypes) -> String {
    let interface = known.called.iter().find(|(hash, _)| *hash == its.interface).map(|(_, description)| description);
    let functions = interface.map_or(&[][..], |interface| &interface.functions);
    let function = functions.iter().find(|function| function.number == its.function);
    let arguments = its.arguments.shown(|bytes| {
        let types = function?.arguments.iter().map(|field| field.ty.clone()).collect();
        Some(decode(&Type::Tuple(types), bytes).ok()?.to_string())
    });
    let name = function.map_or_else(|| format!("function {}, ", its.function), |function| function.name.clone());
    format!("{name}{arguments} to {}", Name::from_raw(its.to))
}

fn replied(its: &NotedReply<'_>, event: Option<&JournalEvent<'_>>, known: &KnownTypes) -> String {
    let NotedReply { is_fault, result } = its;
    if *is_fault {
        return format!("a fault, {}", result.shown(|bytes| Some(String::from_utf8_lossy(bytes).into_owned())));
    }
    let of = |own: &Description, number: u16| {
        own.functions.iter().find(|its| its.number == number).map(|its| its.result.clone())
    };
    let ty = event.and_then(|event| match event {
        JournalEvent::Function { endpoint, number, .. } => of(known.own(*endpoint)?, *number),
        _ => None,
    });
    result.shown(|bytes| Some(decode(&ty?, bytes).ok()?.to_string()))
}
