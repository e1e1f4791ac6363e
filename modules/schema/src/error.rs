//! What can be wrong with bytes, values and arguments, and where.

use std::fmt;

/// A place in the data, and what is wrong there.
///
/// Prints as `ranges_m[3]: 2 bytes missing`, or without a path if the whole is meant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct WalkError {
    /// The way to the place: names of fields and variants, indices of elements. Empty: the whole.
    pub path: String,
    /// What is wrong there.
    pub problem: WalkProblem,
}

/// What is wrong with bytes, a value or an argument.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WalkProblem {
    /// The bytes end too early. Another version of the type wrote them, or they were cut.
    #[error("{} missing", count(*bytes, "byte"))]
    BytesMissing {
        /// At least so many.
        bytes: usize,
    },
    /// The type ends before the bytes do. Another version of the type wrote them.
    #[error("{} too many", count(*bytes, "byte"))]
    BytesLeft {
        /// Bytes that are left.
        bytes: usize,
    },
    /// A list or map claims more elements than the rest of the bytes can hold.
    #[error("claims {claimed} elements, but only {} left", count(*left, "byte"))]
    LengthClaimed {
        /// The claim.
        claimed: u64,
        /// Bytes after the claim.
        left: usize,
    },
    /// Too many elements that take no bytes.
    #[error("more than {} values that take no bytes", crate::EMPTY_MAX)]
    TooManyEmpty,
    /// More values than a message of this length may have: memory and time are bounded by what was sent.
    #[error("more than {most} values in one; send many numbers as bytes, or as lists of f32 or f64")]
    TooManyValues {
        /// So many it may have.
        most: usize,
    },
    /// The description or the value nests too deep.
    #[error("nested more than {} deep", crate::DEPTH_MAX)]
    TooDeep,
    /// A byte that stands for no bool or option.
    #[error("expected a byte 0 or 1, got {got}")]
    BadFlag {
        /// The byte.
        got: u8,
    },
    /// A number in the bytes is larger than its type.
    #[error("a number that does not fit {bits} bits")]
    BadNumber {
        /// Size of the type.
        bits: u32,
    },
    /// Bytes that are no text.
    #[error("text that is not UTF-8")]
    BadText,
    /// Bytes that are no single character.
    #[error("not exactly one character")]
    BadChar,
    /// A variant that the description does not have. Another version of the type wrote it.
    #[error("variant number {index}, but only {} known", count(*known, "variant"))]
    NoSuchVariant {
        /// The number in the bytes.
        index: u64,
        /// Number of known ones.
        known: usize,
    },
    /// A value or word of the wrong kind.
    #[error("expected {expected}, got `{got}`")]
    Expected {
        /// What the description asks for.
        expected: String,
        /// What came, shortened.
        got: String,
    },
    /// A number beyond the range of its type.
    #[error("{got} is out of range: {expected}")]
    OutOfRange {
        /// The type and its range.
        expected: String,
        /// The number.
        got: String,
    },
    /// A tuple of another length.
    #[error("expected {}, got {got}", count(*expected, "element"))]
    WrongLength {
        /// Elements of the description.
        expected: usize,
        /// Elements of the value.
        got: usize,
    },
    /// A field that must be given is not.
    #[error("not given; expected {expected}")]
    FieldMissing {
        /// The type of the field.
        expected: String,
    },
    /// A field that the description does not have.
    #[error("no such field; there is {known}")]
    FieldUnknown {
        /// The fields that there are.
        known: String,
    },
    /// A field is given twice.
    #[error("given twice")]
    FieldTwice,
}

impl WalkProblem {
    /// Whether it is more than is decoded here, and may be right all the same: its sender is not at fault.
    ///
    /// ```
    /// use rohrpost_schema::{Type, decode};
    /// let many = decode(&Type::List(Box::new(Type::Unit)), &[0xff, 0xff, 0xff, 0x07]).unwrap_err();
    /// let cut = decode(&Type::F64, &[0; 7]).unwrap_err();
    /// assert_eq!([many, cut].map(|error| error.problem.is_limit()), [true, false]);
    /// ```
    pub fn is_limit(&self) -> bool {
        matches!(self, Self::TooManyEmpty | Self::TooManyValues { .. } | Self::TooDeep)
    }
}

fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

impl From<WalkProblem> for WalkError {
    fn from(problem: WalkProblem) -> Self {
        Self { path: String::new(), problem }
    }
}

impl WalkError {
    /// The same error, seen from outside of the field or argument `name`.
    ///
    /// ```
    /// use rohrpost_schema::{Schema, parse_argument};
    /// let error = parse_argument(&f64::schema(), "fast").unwrap_err().within("speed_m_s");
    /// assert_eq!(error.to_string(), "speed_m_s: expected a number (f64), got `fast`");
    /// ```
    pub fn within(mut self, name: &str) -> Self {
        let dot = if self.path.is_empty() || self.path.starts_with('[') { "" } else { "." };
        self.path.insert_str(0, dot);
        self.path.insert_str(0, name);
        self
    }

    /// The same error, seen from outside of the element `index`.
    pub(crate) fn within_element(self, index: usize) -> Self {
        self.within(&format!("[{index}]"))
    }
}

impl fmt::Display for WalkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.path.is_empty() {
            // Names come from other processes: no control characters to the terminal.
            write!(f, "{}: ", self.path.escape_debug())?;
        }
        self.problem.fmt(f)
    }
}
