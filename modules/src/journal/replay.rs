//! A journal that is replayed: hands out events and answers, compares outputs.
//!
//! The first thing that differs ends the process: nothing behind it would mean anything, and no code of the module is
//! to run on a made-up answer. What was found is in a file by then.

use super::entry::{ENTRY_BYTES_MAX, Entries, NoEntry};
use super::event::{EventAt, JournalEvent};
use super::outputs::{Begin, KnownTypes, describe};
use super::question::Question;
use super::records::{NamedRecord, RecordSum, Records};
use super::tag::Tag;
use super::verdict::{Difference, ReplayReport, ReplayVerdict};
use rohrpost_schema::Description;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// How far it is, and where to tell the end.
struct ReplayProgress {
    #[cfg_attr(test, expect(dead_code, reason = "a test gets the report by a panic"))]
    path: PathBuf,
    report: RefCell<ReplayReport>,
}

impl ReplayProgress {
    fn stop(&self, verdict: ReplayVerdict) -> ! {
        let report = ReplayReport { verdict, ..self.report.borrow().clone() };
        // A test goes on.
        #[cfg(test)]
        std::panic::resume_unwind(Box::new(report));
        #[cfg(not(test))]
        {
            // What cannot be written is missing, and its reader says so.
            let _ = postcard::to_stdvec(&report).map(|bytes| std::fs::write(&self.path, bytes));
            std::process::exit(0)
        }
    }
}

/// A journal, and where in it the module is.
pub(crate) struct JournalReplay {
    entries: Entries<Box<dyn Read>>,
    /// Content of the present event; nothing before the first.
    event: Vec<u8>,
    known: KnownTypes,
    /// Why it is cut off at its end, if it is.
    ends: Option<String>,
    /// What the recording has of it.
    records: Records,
    /// The record that the module is given next, or now.
    named: Option<NamedRecord>,
    /// What the module says, as a journal has it.
    said: Vec<u8>,
    progress: Rc<ReplayProgress>,
}

/// Content of an entry.
pub(crate) struct Given {
    bytes: Vec<u8>,
    progress: Rc<ReplayProgress>,
}

impl Given {
    /// What is in it.
    pub(crate) fn read<'a, T: Deserialize<'a>>(&'a self) -> T {
        postcard::from_bytes(&self.bytes).unwrap_or_else(|error| {
            let why = format!("what was noted then is not what this program asks for ({error})");
            self.progress.stop(ReplayVerdict::Refused(why))
        })
    }
}

impl JournalReplay {
    pub(super) fn new(from: Box<dyn Read>, records: Records, ends: Option<String>, report: PathBuf) -> Self {
        let progress = Rc::new(ReplayProgress { path: report, report: RefCell::default() });
        let (entries, known) = (Entries::new(from), KnownTypes::default());
        Self { entries, event: Vec::new(), known, ends, records, named: None, said: Vec::new(), progress }
    }

    /// The module's interfaces, under each of its names.
    pub(crate) fn know_own(&mut self, own: Vec<Option<Description>>) {
        self.known.own = own;
    }

    /// An interface that it calls.
    pub(crate) fn know_called(&mut self, hash: u32, description: impl FnOnce() -> Description) {
        if !self.known.called.iter().any(|(known, _)| *known == hash) {
            self.known.called.push((hash, description()));
        }
    }

    /// It is of this module and these settings, wherever their files are now.
    pub(super) fn begin(&mut self, begin: &Begin<'_>) {
        self.compare(Tag::Begin, &(), |_, _| true);
        let given = self.given(0);
        let noted: Begin<'_> = given.read();
        if noted.texts() != begin.texts() {
            self.refuse("it is of another module, or of other settings");
        }
    }

    /// The kind of the next entry. Where the journal ends, so does the replay.
    fn look(&mut self) -> Tag {
        while self.entries.look() == Ok(Tag::Named) {
            self.named = postcard::from_bytes(self.entries.content()).ok();
            self.entries.pass();
        }
        match self.entries.look() {
            Ok(Tag::Hole) => {
                let why: &str = postcard::from_bytes(self.entries.content()).unwrap_or("for no reason told");
                self.refuse(why)
            }
            Ok(tag) => tag,
            // What the module was in when it was killed, or when the recording ended.
            Err(NoEntry::End | NoEntry::Cut) => match &self.ends {
                Some(why) => self.refuse(why),
                None => self.progress.stop(ReplayVerdict::Identical { is_whole: false }),
            },
            Err(NoEntry::Sum) => self.refuse("an entry of the journal is damaged or missing here"),
            Err(NoEntry::Long(len)) => {
                self.refuse(&format!("an entry of the journal has {len} bytes, and {ENTRY_BYTES_MAX} are read"))
            }
            Err(NoEntry::Tag(tag)) => self.refuse(&format!("an entry of the journal is of an unknown kind, {tag}")),
            Err(NoEntry::Unreadable(kind)) => self.refuse(&format!("the journal cannot be read here: {kind}")),
        }
    }

    /// Content of the present entry, from there on.
    fn given(&self, from: usize) -> Given {
        let bytes = self.entries.content().get(from..).unwrap_or_default().to_vec();
        Given { bytes, progress: self.progress.clone() }
    }

    /// The event that comes next. The module's work for the one before is done; behind the last one ends the replay.
    pub(crate) fn next_event(&mut self) -> NextEvent {
        match self.look() {
            Tag::Event => NextEvent(self.given(0)),
            Tag::End => self.progress.stop(ReplayVerdict::Identical { is_whole: true }),
            tag => self.differ(self.describe_next(tag), "its work is done".into()),
        }
    }

    /// Events so far.
    pub(crate) fn events(&self) -> u64 {
        self.progress.report.borrow().events
    }

    /// The module is called with this.
    pub(super) fn event(&mut self, event: &JournalEvent<'_>) {
        let tag = self.look();
        if tag != Tag::Event {
            self.differ(self.describe_next(tag), format!("it {}", event.words()));
        }
        let given = self.given(0);
        let EventAt { at_ns, event: noted } = given.read();
        if noted != *event {
            self.differ(format!("it {}", noted.words()), format!("it {}", event.words()));
        }
        self.entries.pass();
        self.event = given.bytes;
        let mut report = self.progress.report.borrow_mut();
        if report.events == 0 {
            report.first_ns = at_ns;
        }
        report.events += 1;
        report.last_ns = at_ns;
    }

    /// What was noted, when the module asks this.
    pub(super) fn answer(&mut self, tag: Tag, question: &Question<'_>) -> Given {
        self.compare(tag, question, <[u8]>::starts_with);
        self.given(self.said.len())
    }

    /// A record that the recording has.
    pub(super) fn named(&mut self, sum: RecordSum) -> Vec<u8> {
        let what = self.named.filter(|named| named.sum == sum).map_or_else(|| sum.to_string(), |its| its.to_string());
        match self.records.get(sum) {
            Ok(Some(bytes)) => bytes,
            Ok(None) => self.refuse(&format!(
                "{what}, which the module is given here, is not in the recording: the recorder came too late, was too \
                 slow, or the file is a part of it"
            )),
            Err(error) => self.refuse(&format!("{what}, which the module is given here, cannot be read: {error}")),
        }
    }

    /// Compares what the module sends.
    pub(super) fn output<T: Serialize + ?Sized>(&mut self, tag: Tag, output: &T) {
        self.compare(tag, output, <[u8]>::eq);
        let is_end = matches!(tag, Tag::Failed | Tag::Panicked);
        let is_made = self.present().is_some_and(|event| event != JournalEvent::New);
        let not_made = (is_end && !is_made).then(|| self.describe_sent(tag, &self.said));
        let mut report = self.progress.report.borrow_mut();
        report.outputs += 1;
        report.not_made = not_made;
    }

    /// Goes to the next entry, if it is of this kind, and its content fits what the module says.
    fn compare<T: Serialize + ?Sized>(&mut self, tag: Tag, says: &T, fits: fn(&[u8], &[u8]) -> bool) {
        let mut said = std::mem::take(&mut self.said);
        said.clear();
        self.said = postcard::to_extend(says, said).unwrap_or_default();
        let next = self.look();
        if next != tag || !fits(self.entries.content(), &self.said) {
            self.differ(self.describe_next(next), self.describe_sent(tag, &self.said));
        }
        self.entries.pass();
    }

    /// A file has the content that it had.
    pub(super) fn file(&mut self, question: &Question<'_>, path: &Path, found: Option<(u64, u64)>) {
        let noted: Option<(u64, u64)> = self.answer(Tag::File, question).read();
        if noted != found {
            let text = |file: Option<(u64, u64)>| match file {
                Some((len, _)) => format!("{len} bytes"),
                None => "no file".into(),
            };
            let path = path.display();
            self.refuse(&format!("{path} is not the file that it was ({} then, {} now)", text(noted), text(found)));
        }
    }

    /// The next entry, of this kind, in words.
    fn describe_next(&self, tag: Tag) -> String {
        let content = self.entries.content();
        match tag {
            Tag::Event => match postcard::from_bytes::<EventAt<'_>>(content) {
                Ok(EventAt { event, .. }) => format!("its work is done, and next it {}", event.words()),
                Err(_) => "its work is done".into(),
            },
            tag => self.describe_sent(tag, content),
        }
    }

    /// The event that the module is at.
    fn present(&self) -> Option<JournalEvent<'_>> {
        postcard::from_bytes::<EventAt<'_>>(&self.event).ok().map(|its| its.event)
    }

    fn describe_sent(&self, tag: Tag, content: &[u8]) -> String {
        describe(tag, content, self.present().as_ref(), &self.known)
    }

    fn differ(&self, recorded: String, replayed: String) -> ! {
        let event = self.present().map_or_else(|| "begins".into(), |event| event.words());
        self.progress.stop(ReplayVerdict::Differs(Difference { event, recorded, replayed }))
    }

    fn refuse(&self, why: &str) -> ! {
        self.progress.stop(ReplayVerdict::Refused(why.into()))
    }

    /// The module has ended.
    pub(super) fn end(&mut self) -> ! {
        match self.look() {
            Tag::End => self.progress.stop(ReplayVerdict::Identical { is_whole: true }),
            tag => self.differ(self.describe_next(tag), "it ends".into()),
        }
    }

    /// It cannot go on.
    pub(crate) fn give_up(&self, why: &str) -> ! {
        self.refuse(why)
    }
}

/// An event that is to come.
pub(crate) struct NextEvent(Given);

impl NextEvent {
    pub(crate) fn event(&self) -> JournalEvent<'_> {
        self.0.read::<EventAt<'_>>().event
    }
}
