//! A record of a stream, from the beginning of a `with` to its end.

use crate::fails::misuse;
use crate::records::{Hand, Held, Record, Way};
use crate::seat::Stream;
use pyo3::PyTraverseError;
use pyo3::prelude::*;
use pyo3::pyclass::PyVisit;
use rohrpost_native::StayingRecord;
use std::sync::atomic::{AtomicU64, Ordering};

/// For a `with`.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct InHand {
    stream: Py<Stream>,
    way: Py<Way>,
    /// Finds it in the stream, or raises why not; none: it is the newest.
    find: Option<Py<PyAny>>,
    /// The number of its hand, from the end of `__enter__` on; 0: it has none.
    number: AtomicU64,
}

impl InHand {
    pub(crate) fn new(stream: Py<Stream>, way: Py<Way>, find: Option<Py<PyAny>>) -> Self {
        Self { stream, way, find, number: AtomicU64::new(0) }
    }

    /// The record, which is being read from now on.
    fn taken(&self, py: Python<'_>) -> PyResult<(StayingRecord, Entering<'_>)> {
        let stream = self.stream.get();
        if let Some(find) = &self.find {
            drop(find.call0(py)?);
        }
        match stream.take(py, self.find.is_none())? {
            Some((record, number)) => Ok((record, Entering { stream, number })),
            None if self.find.is_none() => Err(told(py, "streams", "no_newest", (&self.way.get().what,))),
            // What Python did since then has read of the stream itself.
            None => Err(misuse(py, &format!("the record of {} that was found is gone", self.way.get().what))),
        }
    }

    /// What is in its hand, and is so no more.
    fn let_go(&self) -> Option<Hand> {
        self.stream.get().let_go(self.number.swap(0, Ordering::Relaxed))
    }
}

#[pymethods]
impl InHand {
    fn __enter__(&self, py: Python<'_>) -> PyResult<Py<Record>> {
        let (record, entering) = self.taken(py)?;
        let info = record.info;
        // It may run code of an author.
        let (value, held) = self.way.get().read(py, record.bytes)?;
        let number = match entering.read(held) {
            Ok(number) => number,
            Err(left) => {
                left.release(py, false)?;
                let what = &self.way.get().what;
                return Err(misuse(py, &format!("a record of {what} was let go while it was being read")));
            }
        };
        // ORDERING: Relaxed, as in `let_go`; the interpreter's lock orders it.
        self.number.store(number, Ordering::Relaxed);
        let made = Py::new(py, Record::new(value, info));
        if made.is_err()
            && let Some(hand) = self.let_go()
        {
            hand.release(py, false)?;
        }
        made
    }

    fn __exit__(
        &self,
        py: Python<'_>,
        error: &Bound<'_, PyAny>,
        _value: &Bound<'_, PyAny>,
        _trace: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let Some(hand) = self.let_go() else {
            return Err(misuse(py, &format!("this `with` has no record of {} in hand", self.way.get().what)));
        };
        let is_told = error.is_none();
        match hand.release(py, is_told)? {
            Some(sequence) if is_told => {
                let what = format!("record {sequence} of {}", self.way.get().what);
                Err(told(py, "views", "kept", (what,)))
            }
            _ => Ok(()),
        }
    }

    /// It changes nothing that it refers to, so something else of a cycle can be cleared, as with a tuple.
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.stream)?;
        visit.call(&self.way)?;
        visit.call(&self.find)
    }
}

/// A record that is being read; whatever comes between, it is in hand no more when this is dropped before its end.
struct Entering<'a> {
    stream: &'a Stream,
    number: u64,
}

impl Entering<'_> {
    /// It was read: the number of its hand; or what was read, if it is in hand no more.
    fn read(self, held: Held) -> Result<u64, Held> {
        self.stream.read(self.number, held).map(|()| self.number)
    }
}

impl Drop for Entering<'_> {
    fn drop(&mut self) {
        self.stream.give_up(self.number);
    }
}

/// An exception that a function of `rohrpost.node` makes.
fn told<'py>(py: Python<'py>, module: &str, function: &str, arguments: impl pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py.import(format!("rohrpost.node.{module}")).and_then(|it| it.getattr(function)?.call1(arguments));
    made.map_or_else(|error| error, PyErr::from_value)
}
