//! Names of those that hold the robot, and a note of it that survives this process: a file of the node's directory,
//! which is memory. So a wormhole that died holds the robot again at its next start, and writing waits for no disk.

use rohrpost_config::ClassTable;
use rohrpost_mailbox::{Name, Node};
use rohrpost_modules::interfaces::HeldHalt;
use rohrpost_modules::runtime::Context;
use rohrpost_supervision::{Driver, HaltId, Halts, Mode, Wormhole};
use serde::{Deserialize, Serialize};
use std::io;
use std::sync::Arc;

/// Characters of a holder's name.
const HOLDER_MAX: usize = 64;

/// The one that holds the robot after a launch of its node, with `starts-held`.
const START: &str = "start@robot";

/// Halts and the mode `failed`, as the file has them: JSON.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Note {
    failed: bool,
    unnamed: bool,
    halts: Vec<HeldHalt>,
    /// The module that has taken over.
    person: Option<String>,
}

/// See the module's head.
pub(super) struct Held {
    /// The core knows a holder by its place here.
    holders: Vec<String>,
    node: Arc<Node>,
    file: String,
    classes: ClassTable,
    noted: (Halts, bool, Option<Name>),
}

impl Held {
    /// Gives the wormhole what was noted before; also the module that has taken over, if one has.
    pub(super) fn restore(context: &Context, starts_held: bool, wormhole: &mut Wormhole) -> (Self, Option<Name>) {
        let node = context.link().borrow().participant().node().clone();
        let file = format!("held-{}", context.installation().classes.format(context.me()));
        let read = || node.read_file(&file).map(Option::unwrap_or_default).map_err(io::Error::other);
        let noted = context.take_in(read);
        let classes = context.installation().classes.clone();
        let mut held = Self { holders: Vec::new(), node, file, classes, noted: Default::default() };
        let mut person = None;
        let told = match noted.map(|bytes| (bytes.is_empty(), serde_json::from_slice::<Note>(&bytes))) {
            Ok((true, _)) if starts_held => held.take(wormhole, HeldHalt { holder: START.into(), number: 0 }),
            Ok((true, _)) => None,
            Ok((false, Ok(note))) => {
                person = note.person.as_ref().and_then(|name| held.classes.parse_module(name).ok());
                held.take_all(wormhole, note)
            }
            Ok((false, Err(error))) => held.fear(wormhole, &error),
            Err(error) => held.fear(wormhole, &error),
        };
        if person.is_some() {
            let _ = wormhole.set_driver(0, Driver::Person);
        }
        held.note(wormhole, person);
        if let Some(told) = told {
            tracing::warn!("the robot stands: {told}");
        }
        (held, person)
    }

    fn take(&mut self, wormhole: &mut Wormhole, HeldHalt { holder, number }: HeldHalt) -> Option<String> {
        let by = self.number_of(&wormhole.halts, &holder);
        // Without room it holds all the same.
        let _ = wormhole.halts.halt(HaltId { by, number });
        Some(format!("held by {holder} from before"))
    }

    fn take_all(&mut self, wormhole: &mut Wormhole, note: Note) -> Option<String> {
        if note.failed {
            wormhole.set_failed();
        }
        if note.unnamed {
            wormhole.halts.halt_unnamed();
        }
        let told: Vec<String> = note.halts.into_iter().filter_map(|halt| self.take(wormhole, halt)).collect();
        let failed = note.failed.then(|| "failed before this start".to_owned());
        let person = note.person.map(|person| format!("{person} drives, until `give_back`"));
        let told: Vec<String> = failed.into_iter().chain(person).chain(told).collect();
        (!told.is_empty()).then(|| told.join(", "))
    }

    /// What cannot be read may have been a halt.
    fn fear(&self, wormhole: &mut Wormhole, error: &dyn std::fmt::Display) -> Option<String> {
        wormhole.halts.halt_unnamed();
        let (file, node) = (&self.file, self.node.path().display());
        Some(format!("held, since `{file}` of {node} cannot be read ({error}); `rohrpost resume --force` lets go"))
    }

    /// The holder's number in the core; one that is held by nobody is given away again.
    pub(super) fn number_of(&mut self, halts: &Halts, holder: &str) -> u32 {
        let known = self.holders.iter().position(|known| known == holder);
        let is_free = |at: &usize| halts.held().all(|halt| halt.by as usize != *at);
        let place = known.or_else(|| (0..self.holders.len()).find(is_free)).unwrap_or(self.holders.len());
        if place == self.holders.len() {
            self.holders.push(String::new());
        }
        if known.is_none() {
            self.holders[place] = holder.to_owned();
        }
        place as u32
    }

    /// All halts that hold the robot, in order.
    pub(super) fn halts(&self, wormhole: &Wormhole) -> Vec<HeldHalt> {
        let named =
            |halt: HaltId| Some(HeldHalt { holder: self.holders.get(halt.by as usize)?.clone(), number: halt.number });
        let mut halts: Vec<HeldHalt> = wormhole.halts.held().filter_map(named).collect();
        halts.sort_by(|one, other| (&one.holder, one.number).cmp(&(&other.holder, other.number)));
        halts
    }

    /// Writes down what holds the robot, if that is news.
    pub(super) fn note(&mut self, wormhole: &Wormhole, person: Option<Name>) {
        let now = (wormhole.halts, wormhole.mode() == Mode::Failed, person);
        if now == self.noted {
            return;
        }
        let person = person.map(|person| self.classes.format(person));
        let note = Note { failed: now.1, unnamed: now.0.has_unnamed(), halts: self.halts(wormhole), person };
        let put = serde_json::to_vec(&note).map_err(|error| error.to_string());
        let put = put.and_then(|bytes| self.node.put_file(&self.file, &bytes).map_err(|error| error.to_string()));
        match put {
            Ok(()) => self.noted = now,
            Err(error) => tracing::error!("halts would not survive this process: {error}"),
        }
    }
}

/// What a wormhole takes of a person's name: letters, digits and signs, and no more than it has room for.
pub fn holder_text(said: &str) -> String {
    said.chars().filter(|c| c.is_alphanumeric() || c.is_ascii_graphic()).take(HOLDER_MAX).collect()
}

/// A holder's name: a module's, or that of a person, which has an `@` as no module's has.
pub(super) fn holder(said: &str, caller: &str) -> String {
    match holder_text(said) {
        said if said.is_empty() => caller.into(),
        said if said.contains('@') => said,
        said => format!("{said}@{caller}"),
    }
}
