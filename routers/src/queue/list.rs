//! Linked lists in an array: places are linked by number. One can be removed from the middle, and nothing is allocated.

const NONE: u32 = u32::MAX;

/// The ends of a list.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct List {
    first: u32,
    last: u32,
}

impl Default for List {
    fn default() -> Self {
        Self { first: NONE, last: NONE }
    }
}

impl List {
    pub(super) fn first(&self) -> Option<u32> {
        (self.first != NONE).then_some(self.first)
    }

    pub(super) fn last(&self) -> Option<u32> {
        (self.last != NONE).then_some(self.last)
    }
}

/// The links of lists that have no place in common.
#[derive(Debug)]
pub(super) struct Lists(Box<[ListNode]>);

#[derive(Clone, Copy, Debug)]
struct ListNode {
    before: u32,
    after: u32,
}

impl Lists {
    pub(super) fn new(places: usize) -> Self {
        Self(vec![ListNode { before: NONE, after: NONE }; places].into())
    }

    pub(super) fn append(&mut self, list: &mut List, place: u32) {
        self.0[place as usize] = ListNode { before: list.last, after: NONE };
        match list.last {
            NONE => list.first = place,
            last => self.0[last as usize].after = place,
        }
        list.last = place;
    }

    pub(super) fn prepend(&mut self, list: &mut List, place: u32) {
        self.0[place as usize] = ListNode { before: NONE, after: list.first };
        match list.first {
            NONE => list.last = place,
            first => self.0[first as usize].before = place,
        }
        list.first = place;
    }

    pub(super) fn remove(&mut self, list: &mut List, place: u32) {
        let ListNode { before, after } = self.0[place as usize];
        match before {
            NONE => list.first = after,
            before => self.0[before as usize].after = after,
        }
        match after {
            NONE => list.last = before,
            after => self.0[after as usize].before = before,
        }
    }

    /// The place behind a place of a list.
    pub(super) fn after(&self, place: u32) -> Option<u32> {
        Some(self.0[place as usize].after).filter(|after| *after != NONE)
    }

    pub(super) fn take_first(&mut self, list: &mut List) -> Option<u32> {
        let first = list.first()?;
        self.remove(list, first);
        Some(first)
    }
}
