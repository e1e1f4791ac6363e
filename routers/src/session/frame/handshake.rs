//! Hello, welcome and refusal: what both ends say of themselves.

use super::fields::FieldReader;
use super::{BadSessionFrame, TimeAnswer, VERSION};

const MAGIC: [u8; 4] = *b"RpTc";
/// Bytes of a name that people read, at most.
pub const NAME_BYTES_MAX: usize = 64;

/// Identity of a client.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SessionHello<'a> {
    /// First byte of the names that it may host.
    pub system: u8,
    /// What is sent to all systems reaches its own without the server.
    pub reaches_own: bool,
    /// Digest of what must be equal everywhere.
    pub common: u64,
    /// Digest of what must be equal inside a system.
    pub system_digest: u64,
    /// Tells this incarnation of the client from others; not 0.
    pub incarnation: u64,
    /// Counts the connections of this incarnation, from 1: of two the later is the true one.
    pub attempt: u64,
    /// Its own time, ns: the first question for the time.
    pub asked_ns: u64,
    /// For people.
    pub name: &'a str,
}

impl<'a> SessionHello<'a> {
    pub(super) fn parse(fields: &mut FieldReader<'a>) -> Result<Self, BadSessionFrame> {
        if fields.array()? != MAGIC {
            return Err(BadSessionFrame::Foreign);
        }
        let (version, system, flags) = (fields.byte()?, fields.byte()?, fields.byte()?);
        if version != VERSION {
            return Err(BadSessionFrame::Version(version));
        }
        fields.zeroes::<1>()?;
        let hello = Self {
            system,
            reaches_own: flags == 1,
            common: fields.long()?,
            system_digest: fields.long()?,
            incarnation: fields.long()?,
            attempt: fields.long()?,
            asked_ns: fields.long()?,
            name: fields.text(NAME_BYTES_MAX)?,
        };
        let is_one = system != 0 && system != rohrpost_mailbox::ALL_SYSTEMS;
        if !is_one || flags > 1 || hello.incarnation == 0 || hello.attempt == 0 {
            return Err(BadSessionFrame::Damaged("a hello of nobody"));
        }
        Ok(hello)
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        into.extend(MAGIC);
        into.extend([VERSION, self.system, u8::from(self.reaches_own), 0]);
        for long in [self.common, self.system_digest, self.incarnation, self.attempt, self.asked_ns] {
            into.extend(long.to_le_bytes());
        }
        into.extend(self.name.as_bytes());
    }
}

/// What the server says of itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Welcome {
    /// Digest of what must be equal everywhere.
    pub common: u64,
    /// Tells this incarnation of the server from others: times of two incarnations have nothing to do with each other.
    pub incarnation: u64,
    /// To the question of the hello.
    pub time: TimeAnswer,
}

impl Welcome {
    pub(super) fn parse(fields: &mut FieldReader<'_>) -> Result<Self, BadSessionFrame> {
        if fields.array()? != MAGIC {
            return Err(BadSessionFrame::Foreign);
        }
        let version = fields.byte()?;
        if version != VERSION {
            return Err(BadSessionFrame::Version(version));
        }
        fields.zeroes::<3>()?;
        Ok(Self { common: fields.long()?, incarnation: fields.long()?, time: TimeAnswer::parse(fields)? })
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        into.extend(MAGIC);
        into.extend([VERSION, 0, 0, 0]);
        into.extend(self.common.to_le_bytes());
        into.extend(self.incarnation.to_le_bytes());
        self.time.write(into);
    }
}

/// Why a server does not accept a client, or ends its session.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum SessionRefusalReason {
    /// Another version of the format.
    Version = 1,
    /// Another digest of what must be equal everywhere.
    Common = 2,
    /// Another digest of what must be equal inside a system.
    System = 3,
    /// It has as many clients as it takes.
    Full = 4,
    /// A later connection of the same client is there.
    Replaced = 5,
    /// It sent what is no frame, or no frame for then.
    Damaged = 6,
    /// Nothing came from it for too long, or too little.
    Silent = 7,
    /// It took nothing for too long.
    Stalled = 8,
    /// The server ends.
    Ending = 9,
    /// Its certificate is of another system.
    Certificate = 10,
}

impl SessionRefusalReason {
    const WORDS: [(Self, &'static str); 10] = [
        (Self::Version, "version"),
        (Self::Common, "common-digest"),
        (Self::System, "system-digest"),
        (Self::Full, "full"),
        (Self::Replaced, "replaced"),
        (Self::Damaged, "damaged"),
        (Self::Silent, "silent"),
        (Self::Stalled, "stalled"),
        (Self::Ending, "ending"),
        (Self::Certificate, "certificate"),
    ];

    /// A word for people and programs.
    pub const fn word(self) -> &'static str {
        // They count from 1.
        Self::WORDS[self as usize - 1].1
    }
}

/// Tells the other end why nothing is taken from it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SessionRefusal<'a> {
    /// Version of the refusing end.
    pub version: u8,
    /// Why.
    pub reason: SessionRefusalReason,
    /// The client's digest of what differs, else 0.
    pub yours: u64,
    /// The one that it should be, else 0.
    pub ours: u64,
    /// The end that has that digest; else what was wrong.
    pub text: &'a str,
}

impl<'a> SessionRefusal<'a> {
    pub(super) fn parse(fields: &mut FieldReader<'a>) -> Result<Self, BadSessionFrame> {
        if fields.array()? != MAGIC {
            return Err(BadSessionFrame::Foreign);
        }
        let (version, reason) = (fields.byte()?, fields.byte()?);
        let reason = SessionRefusalReason::WORDS.into_iter().find(|(known, _)| *known as u8 == reason);
        let (reason, _) = reason.ok_or(BadSessionFrame::Damaged("unknown reason of a refusal"))?;
        fields.zeroes::<2>()?;
        Ok(Self { version, reason, yours: fields.long()?, ours: fields.long()?, text: fields.text(NAME_BYTES_MAX)? })
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        into.extend(MAGIC);
        into.extend([self.version, self.reason as u8, 0, 0]);
        into.extend(self.yours.to_le_bytes());
        into.extend(self.ours.to_le_bytes());
        into.extend(self.text.as_bytes());
    }
}

impl std::fmt::Display for SessionRefusal<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { version, yours, ours, text, .. } = self;
        match self.reason {
            SessionRefusalReason::Version => write!(
                f,
                "the TCP router speaks session format {version}, this end {VERSION}; \
                 run the same version of Rohrpost at both ends (`rohrpost version`)"
            ),
            SessionRefusalReason::Common => write!(
                f,
                "the common digest here is {yours:016x}, that of {text} {ours:016x}; \
                 give both configurations the same classes (`rohrpost check`, on both)"
            ),
            SessionRefusalReason::System => write!(
                f,
                "the system's digest here is {yours:016x}, that of {text} {ours:016x}; \
                 start all of a system from the same file (`rohrpost check`, on both)"
            ),
            SessionRefusalReason::Full if text.is_empty() => {
                write!(f, "the TCP router has as many clients as it takes; raise `clients`, or end some")
            }
            SessionRefusalReason::Full => {
                write!(f, "the TCP router has as many clients as it takes, and {text}; raise `clients`, or end some")
            }
            SessionRefusalReason::Replaced if text.is_empty() => {
                write!(f, "a later connection of this client has taken its place")
            }
            SessionRefusalReason::Replaced => write!(f, "another client has taken its place: {text}"),
            SessionRefusalReason::Damaged => write!(f, "the TCP router could not read what came: {text}"),
            SessionRefusalReason::Silent => write!(f, "the TCP router heard nothing for too long"),
            SessionRefusalReason::Stalled => write!(f, "nothing was read here for too long"),
            SessionRefusalReason::Ending => write!(f, "the TCP router ends"),
            SessionRefusalReason::Certificate => {
                write!(f, "the certificate here does not fit: {text}; use that of this node (`rohrpost keys new`)")
            }
        }
    }
}
