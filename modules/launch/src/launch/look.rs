//! Looks at its node that launch takes for tools elsewhere, and hands out page by page.
//!
//! A look is taken once and kept as bytes; its pages are parts of these, so they belong together however long their
//! reader takes. The oldest look gives way to a new one, and its reader is told to begin anew.

use crate::launcher::{LOOK_BYTES_MAX, LookError, LookPage, SnapshotRequest};
use crate::survey::{MailboxSnapshot, Snapshot, Survey};
use rohrpost_config::Installation;
use rohrpost_mailbox::{InspectError, Name, Node};
use std::collections::VecDeque;

/// Looks that are kept: so many readers may be at it at a time.
const LOOKS_KEPT: usize = 16;
/// Most bytes of a page, whatever its reader asks for: with what is around it, it fits a package.
const PAGE_BYTES_MAX: u16 = 60_000;

/// The looks that launch keeps.
#[derive(Default)]
pub(super) struct Looks {
    kept: VecDeque<(u32, Vec<u8>)>,
    last: u32,
}

impl Looks {
    /// Looks, keeps what was seen, and returns its first page.
    pub(super) fn take(
        &mut self,
        form: u32,
        bytes_max: u16,
        see: impl FnOnce() -> Result<Snapshot, LookError>,
    ) -> Result<LookPage, LookError> {
        if form != Snapshot::format() {
            return Err(LookError::Form(Snapshot::format()));
        }
        let bytes = see()?.to_bytes();
        if bytes.len() > LOOK_BYTES_MAX {
            return Err(LookError::TooLarge(bytes.len() as u32));
        }
        if self.kept.len() >= LOOKS_KEPT {
            self.kept.pop_front();
        }
        self.last = self.last.wrapping_add(1);
        self.kept.push_back((self.last, bytes));
        self.page(self.last, 0, bytes_max)
    }

    /// A page of a look that is kept.
    pub(super) fn page(&self, look: u32, from: u32, bytes_max: u16) -> Result<LookPage, LookError> {
        let (_, bytes) = self.kept.iter().find(|(number, _)| *number == look).ok_or(LookError::Gone)?;
        let rest = bytes.get(from as usize..).unwrap_or_default();
        let long = rest.len().min(bytes_max.min(PAGE_BYTES_MAX).into());
        Ok(LookPage { look, total: bytes.len() as u32, from, bytes: rest[..long].to_vec() })
    }
}

pub(super) fn see(
    what: SnapshotRequest,
    node: &Node,
    installation: &Installation,
    node_name: &str,
) -> Result<Snapshot, LookError> {
    match what {
        SnapshotRequest::Survey(scope) => {
            let survey = Survey::within(scope, node, installation, node_name);
            let mut survey = survey.map_err(|error| LookError::Failed(error.to_string()))?;
            survey.ask_kernel(node);
            Ok(Snapshot::Survey(Box::new(survey)))
        }
        SnapshotRequest::Mailbox(raw) => match MailboxSnapshot::new(node, Name::from_raw(raw)) {
            Ok(look) => Ok(Snapshot::Mailbox(Some(Box::new(look)))),
            Err(InspectError::Missing(_)) => Ok(Snapshot::Mailbox(None)),
            Err(error @ InspectError::Bad(..)) => Err(LookError::Failed(error.to_string())),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_look_goes_and_all_others_stay_whole() {
        let mut looks = Looks::default();
        let take = |looks: &mut Looks| looks.take(Snapshot::format(), 1, || Ok(Snapshot::Mailbox(None))).unwrap();
        let first = take(&mut looks);
        let others: Vec<LookPage> = (1..LOOKS_KEPT).map(|_| take(&mut looks)).collect();
        assert_eq!(looks.page(first.look, 0, 1), Ok(first.clone()), "as many as there is room for");
        take(&mut looks);
        assert_eq!(looks.page(first.look, 0, 1), Err(LookError::Gone));
        others.iter().for_each(|page| assert_eq!(looks.page(page.look, 0, 1), Ok(page.clone())));
    }
}
