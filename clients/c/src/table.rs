//! Handles: which objects this thread has opened.
//!
//! ```text
//!  63        40 39          24 23    16 15     0
//!  ┌───────────┬──────────────┬────────┬────────┐
//!  │ thread    │ turn of place│ kind   │ place  │   0 is no handle
//!  └───────────┴──────────────┴────────┴────────┘
//! ```
//!
//! A table is its thread's own, so a look-up takes no lock. A place that is used again has another turn, and after
//! 65 536 of them it is not used any more: a closed handle leads to nothing for ever.

use crate::code::Code;
use crate::edge::say;
use crate::fork;
use crate::objects::{Kind, Object};
use std::cell::RefCell;
use std::sync::atomic::{AtomicPtr, AtomicU32, Ordering};

/// Places of a table.
const PLACES_MAX: usize = 1 << 16;
const PLACE_MASK: u64 = PLACES_MAX as u64 - 1;
const KIND_MASK: u64 = 0xff << 16;
/// From one turn of a place to the next.
const TURN: u64 = 1 << 24;
/// Threads are told apart by so many bits.
const THREAD_MASK: u32 = (1 << 24) - 1;

/// What a child has of its parent, never dropped. Here, for programs that look for memory which nobody knows any more;
/// marked, since a compiler need not write what nothing reads.
#[used]
static OF_PARENT: AtomicPtr<Vec<Place>> = AtomicPtr::new(std::ptr::null_mut());
/// The last thread that was counted.
static THREADS: AtomicU32 = AtomicU32::new(0);

struct Place {
    /// Of the object; without one, of the next, but for its kind.
    handle: u64,
    /// Its turns are used up: never again, so that no old handle finds another's object.
    is_spent: bool,
    object: Option<Object>,
}

impl Place {
    /// What is there leaves, and its handle leads to nothing from now on.
    fn vacate(&mut self) -> Option<Object> {
        let next = self.handle.wrapping_add(TURN);
        if next >> 40 == self.handle >> 40 {
            self.handle = next;
        } else {
            self.is_spent = true;
        }
        self.object.take()
    }
}

pub(crate) struct Table {
    thread: u32,
    forks: u32,
    places: Vec<Place>,
}

thread_local! {
    static TABLE: RefCell<Table> = RefCell::new(Table::new());
}

impl Table {
    fn new() -> Self {
        fork::watch();
        // Not 0, with which no handle begins.
        let thread = loop {
            match THREADS.fetch_add(1, Ordering::Relaxed) & THREAD_MASK {
                0 => {}
                thread => break thread,
            }
        };
        Self { thread, forks: fork::forks(), places: Vec::new() }
    }

    fn is_forked(&self) -> bool {
        self.forks != fork::forks()
    }

    fn store(&mut self, object: Object, kind: u8) -> Result<u64, Code> {
        let free = self.places.iter().position(|place| place.object.is_none() && !place.is_spent);
        let index = free.unwrap_or(self.places.len());
        if index == PLACES_MAX {
            return Err(say(Code::Crowded, format_args!("this thread has {PLACES_MAX} open handles; close some")));
        }
        if free.is_none() {
            self.places.push(Place {
                handle: u64::from(self.thread) << 40 | index as u64,
                is_spent: false,
                object: None,
            });
        }
        let place = &mut self.places[index];
        place.object = Some(object);
        place.handle = place.handle & !KIND_MASK | u64::from(kind) << 16;
        Ok(place.handle)
    }

    /// The place of a handle, if this is its table. One comparison for all that a handle says.
    #[inline(always)]
    fn place(&mut self, handle: u64) -> Option<&mut Place> {
        let is_forked = self.is_forked();
        let place = self.places.get_mut((handle & PLACE_MASK) as usize);
        place.filter(|place| place.handle == handle && !is_forked)
    }

    /// What a handle stands for.
    #[inline(always)]
    pub(crate) fn find<K: Kind>(&mut self, handle: u64) -> Result<&mut K, Code> {
        let (thread, is_forked) = (self.thread, self.is_forked());
        let object = self.place(handle).and_then(|place| place.object.as_mut());
        object.and_then(K::find).ok_or_else(|| refusal::<K>(handle, thread, is_forked))
    }
}

/// Why a handle leads to no object of this kind in the table of this thread.
#[cold]
fn refusal<K: Kind>(handle: u64, own: u32, is_forked: bool) -> Code {
    let (thread, what) = ((handle >> 40) as u32, K::WHAT);
    if thread == 0 || !is_a::<K>(handle) {
        return say(Code::Handle, format_args!("this is no handle of a {what}"));
    }
    if thread != own {
        return say(Code::Thread, format_args!("this {what} belongs to another thread, which opened it"));
    }
    if is_forked {
        return forked();
    }
    closed::<K>()
}

#[cold]
fn closed<K: Kind>() -> Code {
    say(Code::Closed, format_args!("this {} was closed", K::WHAT))
}

#[cold]
fn forked() -> Code {
    let why = "this thread used Rohrpost before its process was forked";
    say(Code::Forked, format_args!("{why}; what it opened is the parent's: call exec, or use another thread"))
}

impl Drop for Table {
    fn drop(&mut self) {
        if self.is_forked() {
            // Locks and places in the node's table are the parent's: dropping would give them up in its name.
            OF_PARENT.store(Box::into_raw(Box::new(std::mem::take(&mut self.places))), Ordering::Relaxed);
        }
    }
}

/// Uses this thread's table; not while it is used, as a handler of signals would.
#[inline(always)]
pub(crate) fn with_table<T>(use_it: impl FnOnce(&mut Table) -> Result<T, Code>) -> Result<T, Code> {
    let used = TABLE.try_with(|table| match table.try_borrow_mut() {
        Ok(mut table) => use_it(&mut table),
        Err(_) => Err(say(Code::Busy, format_args!("another call of this thread goes on: is this a signal handler?"))),
    });
    used.unwrap_or_else(|_| Err(say(Code::Closed, format_args!("this thread ends, and all its handles are closed"))))
}

/// Makes an object, and gives it a handle.
pub(crate) fn open<K: Kind>(make: impl FnOnce() -> Result<K, Code>) -> Result<u64, Code> {
    with_table(|table| if table.is_forked() { Err(forked()) } else { Ok(()) })?;
    // Other handles may be used meanwhile.
    let object = make()?;
    with_table(|table| table.store(object.store(), K::NUMBER))
}

/// Whether a handle is of this kind, open or not.
pub(crate) fn is_a<K: Kind>(handle: u64) -> bool {
    (handle >> 16) as u8 == K::NUMBER
}

/// Uses what a handle stands for.
#[inline(always)]
pub(crate) fn with<K: Kind, T>(handle: u64, use_it: impl FnOnce(&mut K) -> Result<T, Code>) -> Result<T, Code> {
    with_table(|table| use_it(table.find(handle)?))
}

/// Closes a handle, and gives what it stood for.
pub(crate) fn close<K: Kind>(handle: u64) -> Result<K, Code> {
    with_table(|table| {
        table.find::<K>(handle)?;
        table.place(handle).and_then(Place::vacate).and_then(K::take).ok_or_else(closed::<K>)
    })
}
