//! Contents of a flow: packages of one kind, or of one number of a kind, as the interface of a module declares them.
//!
//! Contents are numbers, since a configuration knows no interface but those of built-in modules; tools that can ask a
//! module show names.

use rohrpost_mailbox::{Kind, Type};
use std::fmt;
use std::str::FromStr;

/// Contents of a flow. Without a number: all of the kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Contents {
    /// Commands, by the number of the receiver's function.
    Command(Option<u16>),
    /// Replies, by the number of the sender's function.
    Reply(Option<u16>),
    /// Data, by their number in the sender's interface.
    Data(Option<u16>),
}

/// A text that is no [`Contents`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ContentsError {
    /// Not one of the three kinds, or more than a kind and a number.
    #[error(
        "`{0}` is no kind of package; write \"data\", \"command\" or \"reply\", if need be with a number: \"data 1\""
    )]
    Kind(String),
    /// A number that no package of the kind has.
    #[error(
        "`{number}` is no number of a {kind}; write {first} to {last}, such as \"{kind} {first}\", or \"{kind}\" for \
         all of them"
    )]
    Number {
        /// What stands in its place.
        number: String,
        /// Its kind.
        kind: &'static str,
        /// The smallest number of that kind.
        first: u16,
        /// The largest.
        last: u16,
    },
}

impl Contents {
    /// All packages of a type; none of a type that nothing has.
    pub const fn of(kind: Kind) -> Option<Self> {
        match kind {
            Kind::Command(number) => Some(Self::Command(Some(number))),
            Kind::Reply(number) => Some(Self::Reply(Some(number))),
            Kind::Data(number) => Some(Self::Data(Some(number))),
            Kind::None => None,
        }
    }

    /// The whole kind.
    pub const fn without_number(self) -> Self {
        match self {
            Self::Command(_) => Self::Command(None),
            Self::Reply(_) => Self::Reply(None),
            Self::Data(_) => Self::Data(None),
        }
    }

    /// The type of its packages, if it is one.
    pub const fn kind(self) -> Option<Kind> {
        match self {
            Self::Command(Some(number)) => Some(Kind::Command(number)),
            Self::Reply(Some(number)) => Some(Kind::Reply(number)),
            Self::Data(Some(number)) => Some(Kind::Data(number)),
            Self::Command(None) | Self::Reply(None) | Self::Data(None) => None,
        }
    }

    const fn parts(self) -> (&'static str, Option<u16>) {
        match self {
            Self::Command(number) => ("command", number),
            Self::Reply(number) => ("reply", number),
            Self::Data(number) => ("data", number),
        }
    }
}

impl fmt::Display for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.parts() {
            (kind, Some(number)) => write!(f, "{kind} {number}"),
            (kind, None) => f.write_str(kind),
        }
    }
}

impl FromStr for Contents {
    type Err = ContentsError;

    fn from_str(text: &str) -> Result<Self, ContentsError> {
        type Of = fn(Option<u16>) -> Contents;
        let mut words = text.split_ascii_whitespace();
        let (contents, kind, first, last): (Of, _, _, _) = match words.next() {
            Some("command") => (Self::Command, "command", 1, Type::COMMAND_MAX),
            Some("reply") => (Self::Reply, "reply", 1, Type::COMMAND_MAX),
            Some("data") => (Self::Data, "data", 0, Type::DATA_MAX),
            _ => return Err(ContentsError::Kind(text.into())),
        };
        match (words.next(), words.next()) {
            (None, _) => Ok(contents(None)),
            (Some(number), None) => {
                let found = number.parse().ok().filter(|number| (first..=last).contains(number));
                let wrong = || ContentsError::Number { number: number.into(), kind, first, last };
                found.map(|number| contents(Some(number))).ok_or_else(wrong)
            }
            (Some(_), Some(_)) => Err(ContentsError::Kind(text.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_it_shows_is_what_it_reads() {
        for (text, contents) in [
            ("data 1", Contents::Data(Some(1))),
            ("data 0", Contents::Data(Some(0))),
            ("data 16384", Contents::Data(Some(16384))),
            ("command 16", Contents::Command(Some(16))),
            ("reply 16383", Contents::Reply(Some(16383))),
            ("data", Contents::Data(None)),
            ("command", Contents::Command(None)),
            ("reply", Contents::Reply(None)),
        ] {
            assert_eq!(text.parse(), Ok(contents), "{text}");
            assert_eq!(contents.to_string(), text);
            assert!(contents.kind().is_none_or(|kind| Contents::of(kind) == Some(contents)), "{text}");
        }
        for text in
            ["", "scan", "data 1 2", "Data 1", "1", "data 16385", "command 0", "reply 16384", "data -1", "data x"]
        {
            assert!(text.parse::<Contents>().is_err(), "{text}");
        }
        assert_eq!(Contents::of(Kind::None), None);
    }
}
