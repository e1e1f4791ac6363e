//! A value of Rust that lends: C has one handle for a sender and its loan, for a receiver and the package in hand.

use std::ptr::NonNull;

/// A value at a fixed address, and at most one thing that is borrowed from it.
pub(crate) struct Lender<T, B> {
    /// Borrowed from `value`; gone before that is used again.
    lent: Option<B>,
    value: NonNull<T>,
}

impl<T, B> Lender<T, B> {
    pub(crate) fn new(value: T) -> Self {
        Self { lent: None, value: NonNull::from(Box::leak(Box::new(value))) }
    }

    /// What is lent now.
    pub(crate) fn lent(&mut self) -> &mut Option<B> {
        &mut self.lent
    }

    /// The value, when nothing is lent; else none.
    pub(crate) fn free(&mut self) -> Option<&mut T> {
        if self.lent.is_some() {
            return None;
        }
        // SAFETY: the box is this lender's own, and nothing is borrowed from it.
        Some(unsafe { self.value.as_mut() })
    }

    /// Lends something of the value, in place of what was lent before, and tells of it.
    ///
    /// # Safety
    /// `lend` keeps nothing of the value but what it returns in `Ok`.
    #[inline(always)]
    pub(crate) unsafe fn lend<E>(
        &mut self,
        lend: impl FnOnce(&'static mut T) -> Result<B, E>,
        tell: impl FnOnce(&mut B),
    ) -> Result<(), E>
    where
        T: 'static,
    {
        self.lent = None;
        // SAFETY: the box lives as long as this lender, which drops what is lent before it uses or drops the value.
        let value = unsafe { &mut *self.value.as_ptr() };
        let lent = lend(value)?;
        // What is replaced is none, and nothing to be dropped. Where a drop could panic here, what is lent would be put
        // together on the stack and copied from there, which takes longer than to receive it (`cargo xtask
        // instructions`, c-receive).
        std::mem::forget(self.lent.replace(lent));
        self.lent.as_mut().map(tell);
        Ok(())
    }

    /// The value, without what was lent.
    pub(crate) fn take(mut self) -> T {
        self.lent = None;
        let value = self.value;
        std::mem::forget(self);
        // SAFETY: it was leaked from a box in `new`, nothing is borrowed from it, and `drop` does not come.
        *unsafe { Box::from_raw(value.as_ptr()) }
    }
}

impl<T, B> Drop for Lender<T, B> {
    fn drop(&mut self) {
        self.lent = None;
        // SAFETY: it was leaked from a box in `new`, and nothing is borrowed from it by now.
        drop(unsafe { Box::from_raw(self.value.as_ptr()) });
    }
}
