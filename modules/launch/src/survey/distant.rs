//! A look at a node elsewhere: its launch takes it, and hands it out page by page.
//!
//! Nothing here waits but [`look_at_all`], and that for a bounded time. A page that gets lost is asked for again.

use super::Snapshot;
use crate::launcher::{LOOK, LOOK_BYTES_MAX, LOOK_ON, LauncherInterface, LookError, LookPage, SnapshotRequest};
use rohrpost_mailbox::{Name, wait_any};
use rohrpost_modules::call::append;
use rohrpost_modules::call::{CallError, Fault, Link};
use std::time::{Duration, Instant};

/// Most bytes of a page: with head, envelope and frame it is one datagram of an Ethernet.
const PAGE_BYTES_MAX: u16 = 1_200;
/// What a reply has besides: its envelope, and what says which page it is.
const PAGE_MARGIN: u16 = 32;
/// Pages that are asked for at a time.
const AHEAD: usize = 4;
/// A page is asked for again after a third of this, and anew after it.
const PAGE_PATIENCE: Duration = Duration::from_millis(400);

/// Why a node could not be looked at.
#[derive(Debug, thiserror::Error)]
pub enum LookFailure {
    /// The node's launch could not be asked, or said something else.
    #[error(transparent)]
    Call(#[from] CallError),
    /// The node's launch does not show it.
    #[error(transparent)]
    Refused(#[from] LookError),
    /// No whole look came within this time.
    #[error("no answer within {0:?}")]
    Silent(Duration),
}

/// A snapshot request to another node. Call [`Distant::poll`] until it is complete; cancel it with [`Distant::forget`].
pub struct Distant {
    launcher: Name,
    what: SnapshotRequest,
    /// Pages that are asked for at a time.
    ahead: usize,
    /// Bytes of a page, such that it fits the reply mailbox.
    page: u16,
    began: Instant,
    timeout: Duration,
    /// The look that pages are of; none until the first has come.
    look: Option<u32>,
    bytes: Vec<u8>,
    /// Bytes that have come.
    there: usize,
    /// First byte that nobody has been asked for.
    next: usize,
    under_way: Vec<AskedPage>,
}

/// A page that was asked for.
struct AskedPage {
    sequence: u32,
    from: usize,
}

impl Distant {
    /// Begins to look at the node of this launch; all of it is to come within `timeout`. Of several looks at a time,
    /// `nodes` is their number: they share the reply mailbox.
    pub fn new(launcher: Name, what: SnapshotRequest, timeout: Duration, nodes: usize) -> Self {
        let ahead = (AHEAD / nodes.max(1)).max(1);
        let (look, bytes, there, next) = (None, Vec::new(), 0, 0);
        let (page, began) = (PAGE_BYTES_MAX, Instant::now());
        Self { launcher, what, ahead, page, began, timeout, look, bytes, there, next, under_way: Vec::new() }
    }

    /// What was seen, or why nothing was; none while it is under way. Asks for what is missing.
    pub fn poll(&mut self, link: &mut Link) -> Option<Result<Snapshot, LookFailure>> {
        let fits = link.replies().shape().body_bytes_max.saturating_sub(PAGE_MARGIN);
        self.page = PAGE_BYTES_MAX.min(fits);
        let step = self.collect(link).and_then(|()| self.ask(link));
        let outcome = match step {
            Err(failure) => Err(failure),
            Ok(()) if self.look.is_some() && self.there == self.bytes.len() => self.read(),
            Ok(()) if self.began.elapsed() >= self.timeout => Err(LookFailure::Silent(self.timeout)),
            Ok(()) => return None,
        };
        self.forget(link);
        Some(outcome)
    }

    /// Gives it up.
    pub fn forget(&mut self, link: &mut Link) {
        self.under_way.drain(..).for_each(|asked| link.forget(asked.sequence));
    }

    fn read(&self) -> Result<Snapshot, LookFailure> {
        Ok(Snapshot::from_bytes(&self.bytes).map_err(|error| CallError::BadReply(self.launcher, error.to_string()))?)
    }

    /// Takes the pages that have come.
    fn collect(&mut self, link: &mut Link) -> Result<(), LookFailure> {
        link.collect();
        for asked in std::mem::take(&mut self.under_way) {
            let read = |bytes: &[u8]| postcard::from_bytes::<Result<LookPage, LookError>>(bytes);
            match link.poll_for(asked.sequence, read) {
                None => self.under_way.push(asked),
                Some(Ok(Ok(page))) => self.take(&asked, &page, link)?,
                Some(Ok(Err(LookError::Gone))) => self.begin_anew(link),
                Some(Ok(Err(error))) => return Err(error.into()),
                Some(Err(error)) if passes(&error) => self.ask_for(asked.from, link)?,
                Some(Err(error)) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn begin_anew(&mut self, link: &mut Link) {
        self.forget(link);
        (self.look, self.there, self.next) = (None, 0, 0);
        self.bytes.clear();
    }

    /// What it says is a claim of another process.
    fn take(&mut self, asked: &AskedPage, page: &LookPage, link: &mut Link) -> Result<(), LookFailure> {
        let total = page.total as usize;
        let fits = |known: usize| {
            let long = known.saturating_sub(asked.from).min(self.page.into());
            known > 0 && known <= LOOK_BYTES_MAX && page.from as usize == asked.from && page.bytes.len() == long
        };
        let bad = || CallError::BadReply(self.launcher, "a page of another look than was asked for".into());
        match self.look {
            None => {
                if !fits(total) {
                    return Err(bad().into());
                }
                self.look = Some(page.look);
                self.bytes = vec![0; total];
                self.next = page.bytes.len();
            }
            Some(look) if look == page.look && fits(self.bytes.len()) => {}
            // The first page, asked for twice, of a look that nobody reads.
            Some(_) if asked.from == 0 => return Ok(()),
            Some(_) => return Err(bad().into()),
        }
        self.bytes[asked.from..][..page.bytes.len()].copy_from_slice(&page.bytes);
        self.there += page.bytes.len();
        self.ask(link)
    }

    /// Asks for as much as may be under way at a time.
    fn ask(&mut self, link: &mut Link) -> Result<(), LookFailure> {
        if self.look.is_none() {
            return if self.under_way.is_empty() { self.ask_for(0, link) } else { Ok(()) };
        }
        while self.under_way.len() < self.ahead && self.next < self.bytes.len() {
            let from = self.next;
            self.next += usize::from(self.page);
            self.ask_for(from, link)?;
        }
        Ok(())
    }

    fn ask_for(&mut self, from: usize, link: &mut Link) -> Result<(), LookFailure> {
        let left = self.timeout.saturating_sub(self.began.elapsed());
        if left.is_zero() {
            return Ok(());
        }
        let (what, look, page) = (self.what, self.look, self.page);
        let function = if look.is_some() { LOOK_ON } else { LOOK };
        let write = |body: &mut Vec<u8>| match look {
            Some(look) => append(body, &(look, from as u32, page)),
            None => append(body, &(what, Snapshot::format(), page)),
        };
        let patience = left.min(PAGE_PATIENCE);
        let sequence = link.begin(self.launcher, function, LauncherInterface::hash(), patience, write)?;
        self.under_way.push(AskedPage { sequence, from });
        Ok(())
    }
}

/// Whether the next try may do better.
fn passes(error: &CallError) -> bool {
    match error {
        CallError::Timeout(..) => true,
        CallError::Fault(_, fault) => {
            matches!(fault, Fault::Busy | Fault::MailboxFull | Fault::RouterFull | Fault::Delayed)
        }
        _ => false,
    }
}

/// Looks at several nodes at once, by the names of their launches; waits for at most `timeout`.
pub fn look_at_all(
    link: &mut Link,
    launchers: &[Name],
    what: SnapshotRequest,
    timeout: Duration,
) -> Vec<Result<Snapshot, LookFailure>> {
    let deadline = Instant::now() + timeout;
    let looks = launchers.iter().map(|launcher| Distant::new(*launcher, what, timeout, launchers.len()));
    let mut looks: Vec<Distant> = looks.collect();
    let mut seen: Vec<Option<Result<Snapshot, LookFailure>>> = launchers.iter().map(|_| None).collect();
    loop {
        for (look, seen) in looks.iter_mut().zip(&mut seen).filter(|(_, seen)| seen.is_none()) {
            *seen = look.poll(link);
        }
        if seen.iter().all(Option::is_some) {
            return seen.into_iter().flatten().collect();
        }
        // The thread that looks after calls repeats them.
        let wake = (Instant::now() + PAGE_PATIENCE / 8).min(deadline);
        wait_any(&mut [link.replies()], Some(wake), || false);
    }
}
