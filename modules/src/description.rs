//! What a module tells of itself: its functions and data, by which tools print, call and record it.

use crate::value::meta::{field, itself, list, structure, text};
use crate::value::{Data, Described, read_described};
use postcard_schema::schema::owned::OwnedNamedType;
use rohrpost_mailbox::{Name, Node, local};
use serde::{Deserialize, Serialize};
use std::hash::Hasher;

/// What an interface offers. A module answers `describe` with it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Description {
    /// Name of the trait.
    pub name: String,
    /// Class of modules that offer it.
    pub class: String,
    /// What it is for.
    pub text: String,
    /// Its functions, by number.
    pub functions: Vec<Function>,
    /// Its data, by number.
    pub data: Vec<DataItem>,
}

/// A function that can be called.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Function {
    /// Command number.
    pub number: u16,
    /// Its name.
    pub name: String,
    /// What it does.
    pub text: String,
    /// Whether running it twice does no harm.
    pub idempotent: bool,
    /// Its arguments, in order.
    pub arguments: Vec<Argument>,
    /// What it returns.
    pub result: OwnedNamedType,
}

/// An argument of a function.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Argument {
    /// Its name.
    pub name: String,
    /// Its type.
    pub ty: OwnedNamedType,
}

/// Data that can be asked for or subscribed to.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct DataItem {
    /// Data number.
    pub number: u16,
    /// Its name.
    pub name: String,
    /// What it is.
    pub text: String,
    /// Its type.
    pub ty: OwnedNamedType,
}

impl Described for Description {
    fn shape() -> OwnedNamedType {
        let number = || field("number", u16::schema());
        let words = || [field("name", text()), field("text", text())];
        let argument = structure("Argument", vec![field("name", text()), field("ty", itself())]);
        let function =
            [field("idempotent", bool::schema()), field("arguments", list(argument)), field("result", itself())];
        let function = structure("Function", [number()].into_iter().chain(words()).chain(function).collect());
        let item = [number()].into_iter().chain(words()).chain([field("ty", itself())]).collect();
        let item = structure("DataItem", item);
        structure(
            "Description",
            vec![
                field("name", text()),
                field("class", text()),
                field("text", text()),
                field("functions", list(function)),
                field("data", list(item)),
            ],
        )
    }
}

impl Description {
    /// What the module under this name has noted of itself beside its command mailbox; asks nobody. None when it noted
    /// nothing that can be read.
    pub fn noted(node: &Node, module: Name) -> Option<Self> {
        read_described(&node.about(module.with_local(local::COMMANDS))?).ok()
    }

    /// Tells interfaces apart: callers and servers must have the same. Numbers, types, and names of functions and arguments
    /// count (to swap two numbers is a mistake that types do not show); texts do not. A mistake goes unseen once in four billion; malice is not what it is for.
    pub fn hash(&self) -> u32 {
        let mut bare = self.clone();
        bare.text.clear();
        bare.functions.iter_mut().for_each(|function| function.text.clear());
        bare.data.iter_mut().for_each(|item| item.text.clear());
        let mut hasher = siphasher::sip::SipHasher13::new();
        // Writing to a growing vector does not fail; an empty hash would be refused by every server.
        hasher.write(&postcard::to_stdvec(&bare).unwrap_or_default());
        hasher.finish() as u32
    }

    /// A function by its name.
    pub fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().find(|function| function.name == name)
    }

    /// Data by its name.
    pub fn data_item(&self, name: &str) -> Option<&DataItem> {
        self.data.iter().find(|item| item.name == name)
    }
}
