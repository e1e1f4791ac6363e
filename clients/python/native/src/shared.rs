//! Bytes of a record in shared memory, for Python: a buffer that knows how many views of it there are.
//!
//! PyO3 makes buffers for Python 3.11 and later alone, so this class is made by hand, of functions that 3.10 has, too.
//!
//! ```text
//! RecordPlace (keeps the memory mapped) ◀── Shared ◀── views: memoryview, its slices, arrays of numpy
//! ```

use pyo3::exceptions::PyBufferError;
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use rohrpost_native::RecordPlace;
use std::cell::UnsafeCell;
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::mem::offset_of;
use std::ops::Range;
use std::ptr;

unsafe extern "C" {
    /// Of Python's. It is in the stable interface from 3.11 on, and in 3.10 all the same. It takes a `Py_buffer`, of
    /// which nothing has to be known here.
    fn PyBuffer_FillInfo(
        view: *mut c_void,
        object: *mut ffi::PyObject,
        first: *mut c_void,
        length: ffi::Py_ssize_t,
        is_readonly: c_int,
        flags: c_int,
    ) -> c_int;
}

/// As Python has it.
#[repr(C)]
struct Object {
    head: ffi::PyObject,
    /// How many views there are; changed with the interpreter's lock alone.
    views: ffi::Py_ssize_t,
    address: ffi::Py_ssize_t,
    length: ffi::Py_ssize_t,
    is_readonly: c_int,
    /// Its record is lent no more, so there are no new views; changed as `views` is.
    is_over: c_int,
    place: RecordPlace,
}

/// Bytes in shared memory, which stays mapped as long as this is there.
pub(crate) struct Shared(Py<PyAny>);

impl Shared {
    /// A part of a record that is read, or of one that is being filled.
    pub(crate) fn new(py: Python<'_>, place: RecordPlace, range: Range<usize>, is_readonly: bool) -> PyResult<Self> {
        // What is seen through it lies within the record, whatever was asked for.
        let (start, end) = (range.start.min(place.len()), range.end.min(place.len()));
        let address = place.address().as_ptr().expose_provenance().saturating_add(start);
        let (Ok(address), Ok(length)) = (isize::try_from(address), isize::try_from(end.saturating_sub(start))) else {
            return Err(PyBufferError::new_err("memory beyond what Python can address"));
        };
        let class = CLASS.get_or_try_init(py, || class(py))?.as_ptr().cast::<ffi::PyTypeObject>();
        // SAFETY: `class` is a type, which stays; all fields of its new object but the head are written before anybody
        // sees it.
        unsafe {
            let object = ffi::PyType_GenericAlloc(class, 0);
            let made = Bound::from_owned_ptr_or_err(py, object)?;
            let object = object.cast::<Object>();
            ptr::addr_of_mut!((*object).views).write(0);
            ptr::addr_of_mut!((*object).address).write(address);
            ptr::addr_of_mut!((*object).length).write(length);
            ptr::addr_of_mut!((*object).is_readonly).write(c_int::from(is_readonly));
            ptr::addr_of_mut!((*object).is_over).write(0);
            ptr::addr_of_mut!((*object).place).write(place);
            Ok(Self(made.unbind()))
        }
    }

    /// A view of all of it: a `memoryview`.
    pub(crate) fn view<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        // SAFETY: an object, which is borrowed; the result is a new one, or none with an exception set.
        unsafe { Bound::from_owned_ptr_or_err(py, ffi::PyMemoryView_FromObject(self.0.as_ptr())) }
    }

    /// There are no new views of it from now on; whether no old one is left.
    pub(crate) fn end(&self, _: Python<'_>) -> bool {
        // SAFETY: it is of the class below, as `new` made it; the interpreter's lock is held.
        unsafe { ended(self.0.as_ptr().cast()) }
    }

    /// As Python has it.
    pub(crate) fn into_any(self) -> Py<PyAny> {
        self.0
    }
}

const OVER: &CStr = c"the record of these bytes is in hand no more; copy what you keep: `bytes(…)`, `numpy.array(…)`";

static CLASS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// Python cannot make objects of it, nor change it, nor make a class of it.
const FLAGS: u64 = ffi::Py_TPFLAGS_DEFAULT | ffi::Py_TPFLAGS_DISALLOW_INSTANTIATION | ffi::Py_TPFLAGS_IMMUTABLETYPE;

/// Python reads them as long as there is the class, so for ever.
struct Methods(UnsafeCell<[ffi::PyMethodDef; 2]>);

// SAFETY: Python reads them alone, and with its lock.
unsafe impl Sync for Methods {}

static METHODS: Methods = Methods(UnsafeCell::new([
    ffi::PyMethodDef {
        ml_name: c"end".as_ptr(),
        ml_meth: ffi::PyMethodDefPointer { PyCFunction: end },
        ml_flags: ffi::METH_NOARGS,
        ml_doc: c"There are no new views of it from now on; whether no old one is left.".as_ptr(),
    },
    ffi::PyMethodDef::zeroed(),
]));

impl Methods {
    fn get(&self) -> *mut ffi::PyMethodDef {
        self.0.get().cast()
    }
}

fn class(py: Python<'_>) -> PyResult<Py<PyAny>> {
    // The class has copies of these, or of what is in them, but of the names.
    let mut members =
        [member(c"length", offset_of!(Object, length), c"How many there are."), ffi::PyMemberDef::default()];
    let slot = |slot, pfunc| ffi::PyType_Slot { slot, pfunc };
    let mut slots = [
        slot(ffi::Py_bf_getbuffer, get_buffer as *mut c_void),
        slot(ffi::Py_bf_releasebuffer, release_buffer as *mut c_void),
        slot(ffi::Py_tp_dealloc, dealloc as *mut c_void),
        slot(ffi::Py_tp_members, members.as_mut_ptr().cast()),
        slot(ffi::Py_tp_methods, METHODS.get().cast()),
        slot(0, ptr::null_mut()),
    ];
    let mut spec = ffi::PyType_Spec {
        name: c"rohrpost._node.Shared".as_ptr(),
        basicsize: size_of::<Object>() as c_int,
        itemsize: 0,
        flags: FLAGS as c_uint,
        slots: slots.as_mut_ptr(),
    };
    // SAFETY: `spec` says what an `Object` is, as are the functions; all of it lasts beyond the call, and the name for
    // ever. The result is a new type, or none with an exception set.
    unsafe { Bound::from_owned_ptr_or_err(py, ffi::PyType_FromSpec(&raw mut spec)).map(Bound::unbind) }
}

fn member(name: &'static CStr, offset: usize, text: &'static CStr) -> ffi::PyMemberDef {
    let (name, doc): (*const c_char, *const c_char) = (name.as_ptr(), text.as_ptr());
    let offset = offset as ffi::Py_ssize_t;
    ffi::PyMemberDef { name, type_code: ffi::Py_T_PYSSIZET, offset, flags: ffi::Py_READONLY, doc }
}

/// # Safety
/// With an object of the class, and the interpreter's lock.
unsafe fn ended(it: *mut Object) -> bool {
    // SAFETY: as above.
    unsafe {
        (*it).is_over = 1;
        (*it).views == 0
    }
}

/// Python's `end`.
unsafe extern "C" fn end(object: *mut ffi::PyObject, _: *mut ffi::PyObject) -> *mut ffi::PyObject {
    // SAFETY: Python calls it with an object of the class, and its lock.
    unsafe { ffi::PyBool_FromLong(ended(object.cast()).into()) }
}

/// Somebody wants a view.
unsafe extern "C" fn get_buffer(object: *mut ffi::PyObject, view: *mut c_void, flags: c_int) -> c_int {
    let it = object.cast::<Object>();
    // SAFETY: Python calls it with an object of the class, a `Py_buffer` to fill, and its lock. The view holds the
    // object, which keeps its memory mapped.
    unsafe {
        if (*it).is_over != 0 {
            if !view.is_null() {
                // Python wants to see there that it got none: `obj`, the second of a `Py_buffer`, after an address.
                view.cast::<*mut ffi::PyObject>().add(1).write(ptr::null_mut());
            }
            ffi::PyErr_SetString(ffi::PyExc_BufferError, OVER.as_ptr());
            return -1;
        }
        let first = ptr::with_exposed_provenance_mut((*it).address as usize);
        let filled = PyBuffer_FillInfo(view, object, first, (*it).length, (*it).is_readonly, flags);
        if filled == 0 {
            (*it).views += 1;
        }
        filled
    }
}

/// A view is not needed any more, nor what was made of it.
unsafe extern "C" fn release_buffer(object: *mut ffi::PyObject, _: *mut c_void) {
    // SAFETY: Python calls it once for each view that it got, with its lock.
    unsafe { (*object.cast::<Object>()).views -= 1 }
}

unsafe extern "C" fn dealloc(object: *mut ffi::PyObject) {
    // SAFETY: Python calls it once, when nothing refers to the object any more, so no view either; `new` wrote all of
    // its fields. What was allocated goes back, and the reference to its class.
    unsafe {
        let class = ffi::Py_TYPE(object);
        ptr::drop_in_place(ptr::addr_of_mut!((*object.cast::<Object>()).place));
        ffi::PyObject_Free(object.cast());
        ffi::Py_DECREF(class.cast());
    }
}
