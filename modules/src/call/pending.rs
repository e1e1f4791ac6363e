//! A call under way, as its caller holds it.

use super::{CallError, Caller};
use rohrpost_mailbox::Name;

/// A call that was begun: [`Pending::wait`] for its result. Dropped, it is given up (the server may run it all the
/// same).
///
/// ```
/// use rohrpost_modules::call::{CallError, Pending};
///
/// fn both(left: Pending<f64>, right: Pending<f64>) -> Result<f64, CallError> {
///     Ok(left.wait()? + right.wait()?) // both servers work at the same time
/// }
/// ```
#[must_use = "a call that is begun and not waited for is given up"]
pub struct Pending<T> {
    link: Caller,
    sequence: u32,
    to: Name,
    result: std::marker::PhantomData<fn() -> T>,
}

impl<T: serde::de::DeserializeOwned> Pending<T> {
    /// Handle of a call that the link's [`super::Link::begin`] began.
    pub fn new(link: Caller, sequence: u32, to: Name) -> Self {
        Self { link, sequence, to, result: std::marker::PhantomData }
    }

    /// Waits for the result.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn wait(self) -> Result<T, CallError> {
        self.link.wait(self.sequence, self.to)
    }
}

impl<T: serde::de::DeserializeOwned, E: serde::de::DeserializeOwned> Pending<Result<T, E>> {
    /// Waits for the result of a function that has an error of its own.
    ///
    /// ```
    /// use rohrpost_modules::call::{CallError, Pending};
    /// use rohrpost_modules::interfaces::DriveError;
    ///
    /// fn has_driven(drive: Pending<Result<(), DriveError>>) -> bool {
    ///     match drive.wait_result() {
    ///         Ok(()) => true,
    ///         Err(CallError::Module(motor, error)) => panic!("{motor} refused: {error}"),
    ///         Err(_) => false, // it did not answer, say
    ///     }
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn wait_result(self) -> Result<T, CallError<E>> {
        let to = self.to;
        self.wait().map_err(CallError::widen)?.map_err(|error| CallError::Module(to, error))
    }
}

impl<T> Drop for Pending<T> {
    fn drop(&mut self) {
        self.link.forget(self.sequence);
    }
}
