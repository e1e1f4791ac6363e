//! Why no code is made of an interface.

use rohrpost::output::plain;

pub(super) const NAME_BYTES_MAX: usize = 200;
/// Types inside of each other: what compilers of all languages take without being told.
pub(super) const DEPTH_MAX: usize = 64;

/// A place in the interface, and what is wrong there.
#[derive(Debug, PartialEq)]
pub(super) struct Refusal {
    /// Names on the way there: `drive.speed`, `Order.Turn`. Empty: the whole.
    pub(super) place: String,
    pub(super) problem: RefusedFor,
}

/// What is wrong.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(super) enum RefusedFor {
    #[error("a name is empty; each function, argument, field, variant and type needs one")]
    NoName,
    #[error("a name of {0} bytes; {max} are enough", max = NAME_BYTES_MAX)]
    LongName(usize),
    #[error("a name with control characters")]
    ControlName,
    #[error("`{0}` is there twice")]
    Twice(String),
    #[error("number {0}; those of {1} are {2}")]
    Number(u16, &'static str, &'static str),
    #[error("number {0} stands behind {1}; an interface has them in order, each once")]
    Order(u16, u16),
    #[error("types nested more than {max} deep", max = DEPTH_MAX)]
    Deep,
    #[error("one of its parts has a name, `{0}`, where parts have none")]
    PartName(String),
    #[error("{language} cannot have {what}; {instead}")]
    Language { language: &'static str, what: String, instead: &'static str },
}

/// What a language cannot have at a place, and what to take instead.
pub(super) fn cannot(language: &'static str, place: &str, what: impl Into<String>, instead: &'static str) -> Refusal {
    RefusedFor::Language { language, what: what.into(), instead }.at(place)
}

impl RefusedFor {
    pub(super) fn at(self, place: impl Into<String>) -> Refusal {
        Refusal { place: place.into(), problem: self }
    }
}

impl std::error::Error for Refusal {}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = self.problem.to_string();
        if !self.place.is_empty() {
            write!(f, "{}: ", plain::line(&self.place))?;
        }
        f.write_str(&plain::line(&text))
    }
}
