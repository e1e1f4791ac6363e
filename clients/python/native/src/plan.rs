//! How the value of a record is made where its type is simple: numbers, text and bytes in structs, as in pictures.
//!
//! Python makes the plan of a type once (`rohrpost.node.plans`), and reads itself what has none.

use crate::lent::is_forked;
use crate::shared::Shared;
use pyo3::PyTraverseError;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::PyVisit;
use pyo3::types::{PyBytes, PyFloat, PyString, PyTuple};
use rohrpost_native::RecordPlace;

/// Of one type.
pub(crate) enum Plan {
    Bool,
    /// Whole numbers of this many bits.
    Unsigned(u32),
    Signed(u32),
    F32,
    F64,
    Text,
    /// A view, if there are at least so many; else a copy.
    Bytes(u64),
    /// A choice of these.
    Words(Vec<Py<PyAny>>),
    /// What makes it, and of what.
    Struct(Py<PyAny>, Vec<Plan>),
}

/// Why a value was not made by its plan.
enum Unread {
    /// The bytes are not of this type, or are for Python to read.
    Bytes,
    /// An author's class raised it.
    Raised(PyErr),
}

impl From<PyErr> for Unread {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}

/// A part of a record that Python has a view of.
pub(crate) struct LentPart {
    shared: Shared,
    view: Py<PyAny>,
}

impl LentPart {
    /// Closes the view, and lets nobody have another; whether nobody has any part of it.
    pub(crate) fn release(&self, py: Python<'_>) -> bool {
        // It fails where something has the view itself, which is a view that is left.
        let _ = self.view.call_method0(py, pyo3::intern!(py, "release"));
        self.shared.end(py)
    }

    /// What it has refers to nothing more that has a part in cycles.
    pub(crate) fn visit(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.view)
    }
}

impl Plan {
    /// As Python has it: a tuple of a word and what belongs to it.
    pub(crate) fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (word, more): (String, Bound<'_, PyAny>) = given.extract()?;
        Ok(match word.as_str() {
            "bool" => Self::Bool,
            "unsigned" => Self::Unsigned(more.extract()?),
            "signed" => Self::Signed(more.extract()?),
            "f32" => Self::F32,
            "f64" => Self::F64,
            "text" => Self::Text,
            "bytes" => Self::Bytes(more.extract()?),
            "words" => Self::Words(more.extract()?),
            "struct" => {
                let (make, parts): (Py<PyAny>, Vec<Bound<'_, PyAny>>) = more.extract()?;
                Self::Struct(make, parts.iter().map(Self::of).collect::<PyResult<_>>()?)
            }
            _ => return Err(PyValueError::new_err(format!("no plan is called `{word}`"))),
        })
    }

    /// The value that all of a record is; none: Python is to read it, or to say what is wrong with it. What was lent of
    /// the record is put into `lent` in each case.
    ///
    /// The record is in hand, its `Hand` without a `Held`, until this returns.
    pub(crate) fn read<'py>(
        &self,
        py: Python<'py>,
        place: &RecordPlace,
        lent: &mut Vec<LentPart>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        // SAFETY: so many bytes of a mapping that `place` keeps. The record is held, so its writer goes round it: while
        // it is being read, `Stream::let_go` does not let it go, and `Stream::read_once` reads no other, whatever an
        // author's class does; and in a child that it forks, nothing more is read.
        let bytes = unsafe { std::slice::from_raw_parts(place.address().as_ptr(), place.len()) };
        let mut reading = Reading { py, place, bytes, at: 0, lent };
        match reading.value(self) {
            Ok(value) if reading.at == bytes.len() => Ok(Some(value)),
            Err(Unread::Raised(error)) if !error.is_instance_of::<PyException>(py) => Err(error),
            Ok(_) | Err(Unread::Raised(_) | Unread::Bytes) => Ok(None),
        }
    }

    pub(crate) fn visit(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        match self {
            Self::Words(words) => words.iter().try_for_each(|word| visit.call(word)),
            Self::Struct(make, parts) => {
                visit.call(make)?;
                parts.iter().try_for_each(|part| part.visit(visit))
            }
            _ => Ok(()),
        }
    }
}

struct Reading<'a, 'py> {
    py: Python<'py>,
    place: &'a RecordPlace,
    bytes: &'a [u8],
    at: usize,
    lent: &'a mut Vec<LentPart>,
}

impl<'a, 'py> Reading<'a, 'py> {
    fn value(&mut self, plan: &Plan) -> Result<Bound<'py, PyAny>, Unread> {
        let py = self.py;
        Ok(match plan {
            Plan::Bool => match self.take(1)? {
                [byte @ 0..=1] => (*byte == 1).into_pyobject(py).map_err(PyErr::from)?.to_owned().into_any(),
                _ => return Err(Unread::Bytes),
            },
            Plan::Unsigned(bits) => self.number(*bits)?.into_pyobject(py).map_err(PyErr::from)?.into_any(),
            Plan::Signed(8) => i8::from_le_bytes(self.array()?).into_pyobject(py).map_err(PyErr::from)?.into_any(),
            Plan::Signed(bits) => {
                let number = self.number(*bits)?;
                let signed = (number >> 1) as i64 ^ -((number & 1) as i64);
                signed.into_pyobject(py).map_err(PyErr::from)?.into_any()
            }
            Plan::F32 => PyFloat::new(py, f32::from_le_bytes(self.array()?).into()).into_any(),
            Plan::F64 => PyFloat::new(py, f64::from_le_bytes(self.array()?)).into_any(),
            Plan::Text => {
                let text = std::str::from_utf8(self.counted()?).map_err(|_| Unread::Bytes)?;
                PyString::new(py, text).into_any()
            }
            Plan::Bytes(viewed_min) => self.octets(*viewed_min)?,
            Plan::Words(words) => {
                let index = usize::try_from(self.number(32)?).map_err(|_| Unread::Bytes)?;
                words.get(index).ok_or(Unread::Bytes)?.bind(py).clone()
            }
            Plan::Struct(make, parts) => {
                let values = parts.iter().map(|part| self.value(part)).collect::<Result<Vec<_>, _>>()?;
                let made = make.bind(py).call1(PyTuple::new(py, values)?)?;
                if is_forked() {
                    // It came back in a child, for which nobody holds the record.
                    return Err(Unread::Bytes);
                }
                made
            }
        })
    }

    fn octets(&mut self, viewed_min: u64) -> Result<Bound<'py, PyAny>, Unread> {
        let bytes = self.counted()?;
        if (bytes.len() as u64) < viewed_min {
            return Ok(PyBytes::new(self.py, bytes).into_any());
        }
        let shared = Shared::new(self.py, self.place.clone(), self.at - bytes.len()..self.at, true)?;
        let view = shared.view(self.py)?;
        self.lent.push(LentPart { shared, view: view.clone().unbind() });
        Ok(view)
    }

    fn counted(&mut self) -> Result<&'a [u8], Unread> {
        let length = usize::try_from(self.number(64)?).map_err(|_| Unread::Bytes)?;
        self.take(length)
    }

    /// A whole number without a sign; 8 bits are as they are, more are seven a byte.
    fn number(&mut self, bits: u32) -> Result<u64, Unread> {
        if bits == 8 {
            return Ok(u8::from_le_bytes(self.array()?).into());
        }
        let (mut number, mut shift) = (0_u64, 0);
        while shift < bits {
            let [byte] = self.array()?;
            let seven = u64::from(byte & 0x7F);
            if bits - shift < 7 && seven >> (bits - shift) != 0 {
                break;
            }
            number |= seven << shift;
            if byte < 0x80 {
                return Ok(number);
            }
            shift += 7;
        }
        Err(Unread::Bytes)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Unread> {
        self.take(N)?.try_into().map_err(|_| Unread::Bytes)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], Unread> {
        let bytes = self.bytes.get(self.at..).and_then(|left| left.get(..length)).ok_or(Unread::Bytes)?;
        self.at += length;
        Ok(bytes)
    }
}
