//! Sizes of a module's mailboxes, and their behaviour when full.

use crate::reader::Section;
use rohrpost_mailbox::{BODY_BYTES_MAX, OverflowPolicy, Shape};
use std::time::Duration;

/// Most slots of one mailbox.
pub const SLOTS_MAX: u16 = rohrpost_mailbox::SLOTS_MAX as u16;
/// Most unfinished claims of one participant, in a mailbox of the file.
pub const CLAIMS_MAX: u8 = 16;

/// One mailbox of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MailboxSpec {
    /// Packages it holds, 1..=[`SLOTS_MAX`].
    pub slots: u16,
    /// Largest body in bytes, 1..=65519.
    pub size: u32,
    /// What happens when it is full.
    pub full: OverflowPolicy,
    /// Older packages are dropped when the module receives.
    pub max_age: Option<Duration>,
    /// Unfinished claims that one participant may hold; in the file 1..=[`CLAIMS_MAX`].
    pub claims: u8,
}

/// The mailbox in which a router takes packages to other nodes: slots for the largest body each. A package that waited
/// longer than `max_age` is dropped without a reply to its caller: only a stopped router leaves it there for so long.
/// The caller's next try gets through, where a reply would end its call. A participant has a sender into it, and so a
/// claim, for each mailbox of another node that it sends to.
pub const TRANSIT: MailboxSpec = MailboxSpec {
    slots: 64,
    size: BODY_BYTES_MAX as u32,
    full: OverflowPolicy::Displace,
    max_age: Some(Duration::from_secs(2)),
    claims: u8::MAX,
};

impl MailboxSpec {
    /// Bytes of shared memory that it takes, all in all.
    pub fn memory(&self) -> u64 {
        let body_bytes_max = u16::try_from(self.size).unwrap_or(u16::MAX);
        Shape { slots: self.slots, body_bytes_max, ..Shape::default() }.segment_bytes() as u64
    }
}

/// The mailboxes that every module has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mailboxes {
    /// Takes commands (local id 0).
    pub commands: MailboxSpec,
    /// Takes the replies to the module's own commands (local id 1).
    pub replies: MailboxSpec,
    /// Takes the module's subscribed data (local id 2).
    pub data: MailboxSpec,
}

impl Default for Mailboxes {
    fn default() -> Self {
        let spec = |slots, size| MailboxSpec { slots, size, full: OverflowPolicy::Displace, max_age: None, claims: 1 };
        Self { commands: spec(32, 1024), replies: spec(32, 4096), data: spec(64, 4096) }
    }
}

/// Lines of a module's mailboxes, or the line of the module for a mailbox without a section.
#[derive(Clone, Copy)]
pub(crate) struct SpecLines {
    pub(crate) slots: usize,
    pub(crate) size: usize,
}

/// Lines of the three, for checks across modules.
pub(crate) type MailboxLines = [SpecLines; 3];

/// Lines of mailboxes without a section: that of their module.
pub(crate) fn lines_at(line: usize) -> MailboxLines {
    [SpecLines { slots: line, size: line }; 3]
}

impl Mailboxes {
    /// The three, with the names that the file gives them.
    pub fn each(&self) -> [(&'static str, &MailboxSpec); 3] {
        [("commands", &self.commands), ("replies", &self.replies), ("data", &self.data)]
    }

    pub(crate) fn read(section: Option<Section<'_>>, module: &str, module_line: usize) -> (Self, MailboxLines) {
        let mut mailboxes = Self::default();
        let mut lines = lines_at(module_line);
        let Some(section) = section else { return (mailboxes, lines) };
        let specs = [&mut mailboxes.commands, &mut mailboxes.replies, &mut mailboxes.data];
        for ((key, spec), line) in ["commands", "replies", "data"].into_iter().zip(specs).zip(&mut lines) {
            if let Some(section) = section.section(key, &format!("{module}, mailbox `{key}`")) {
                *line = SpecLines { slots: section.line, size: section.line };
                spec.read(section, line, key == "data");
            }
        }
        section.finish();
        (mailboxes, lines)
    }
}

impl MailboxSpec {
    /// Changes the keys of the section and keeps the rest. `latest`: whether a newer package may replace an older one
    /// here.
    fn read(&mut self, section: Section<'_>, line: &mut SpecLines, latest: bool) {
        if let Some(item) = section.get("slots") {
            line.slots = item.line;
            self.slots = item.whole(1..=SLOTS_MAX, self.slots).unwrap_or(self.slots);
        }
        if let Some(item) = section.get("size") {
            line.size = item.line;
            self.size = item.size(1..=BODY_BYTES_MAX as u64, "1 KiB").map_or(self.size, |size| size as u32);
        }
        self.full = section.or("full", self.full, |item| {
            if !latest && item.is(OverflowPolicy::Latest.name()) {
                item.report(
                    "`full` is \"latest\"; write \"displace\" or \"reject\": each command has an id of its own, so \
                     none replaces another",
                );
                return None;
            }
            let all = OverflowPolicy::ALL.into_iter().filter(|full| latest || *full != OverflowPolicy::Latest);
            item.choice(&all.map(|full| (full.name(), full)).collect::<Vec<_>>())
        });
        self.max_age = section.get("max-age").and_then(|item| item.duration_above_zero("2 s"));
        self.claims = section.whole_or("claims", 1..=CLAIMS_MAX, self.claims);
        section.finish();
    }
}
