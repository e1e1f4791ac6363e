//! What a sender remembers of its own packages in a `latest` mailbox, so that the next of the same state replaces them.
//!
//! Two packages of one sender are of the same state if `from`, `kind` and `id` of their heads are the same. A
//! subscription's data have one id, so the newer replaces the older; commands each have their own, so none is ever
//! replaced: the caller waits for the answer.

use crate::label::Label;
use crate::memory::layout::Shape;
use crate::name::Name;
use crate::package::Type;
use crate::slots::full::OverflowPolicy;
use crate::slots::protocol::{Posted, Slots};

/// The last package of each state that this sender sent. Private to it, and bounded: whether one still waits, its word
/// says.
pub(crate) struct Posts {
    posts: Vec<(LatestState, Posted)>,
    /// One for each slot; 0 when the mailbox is not `latest`.
    most: usize,
}

type LatestState = (Name, Type, u16);

fn state(label: &Label) -> LatestState {
    (label.from, label.kind, label.id)
}

impl Posts {
    /// All the memory that it will ever need.
    pub(crate) fn new(shape: &Shape) -> Self {
        let most = if shape.full == OverflowPolicy::Latest { usize::from(shape.slots) } else { 0 };
        Self { posts: Vec::with_capacity(most), most }
    }

    /// The last of the same state as this one.
    #[inline]
    pub(crate) fn of(&self, label: &Label) -> Option<Posted> {
        if self.posts.is_empty() { None } else { self.find(label) }
    }

    #[inline(never)]
    fn find(&self, label: &Label) -> Option<Posted> {
        self.posts.iter().find(|(of, _)| *of == state(label)).map(|(_, posted)| *posted)
    }

    /// Keeps what was just published.
    #[inline]
    pub(crate) fn remember(&mut self, label: &Label, posted: Posted, slots: &Slots<'_>) {
        if self.most > 0 {
            self.remember_latest(label, posted, *slots);
        }
    }

    #[inline(never)]
    fn remember_latest(&mut self, label: &Label, posted: Posted, slots: Slots<'_>) {
        let of = state(label);
        let gone = |(_, old): &(LatestState, Posted)| slots.load(old.slot) != old.word;
        if let Some(same) = self.posts.iter_mut().find(|(there, _)| *there == of) {
            same.1 = posted;
        } else if self.posts.len() < self.most {
            self.posts.push((of, posted));
        } else if let Some(gone) = self.posts.iter_mut().find(|old| gone(old)) {
            // There is one: of as many packages as there are slots, one lost its slot to that which was just published.
            *gone = (of, posted);
        }
    }
}
