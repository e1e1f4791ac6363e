//! The edge to C: no panic leaves it, each failure leaves its words, and pointers are looked at before they are used.

use crate::code::{Code, Coded, text_of};
use rohrpost_mailbox::Waiting;
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, c_char, c_void};
use std::fmt::{Arguments, Write};
use std::io::Write as _;
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// Bytes of a thread's last error, its end included. In place, so that a full mailbox costs no heap.
const MESSAGE_BYTES: usize = 1024;

/// What a call of this thread said last when it failed.
struct Message {
    /// How often this thread has said something.
    count: u32,
    len: usize,
    bytes: [u8; MESSAGE_BYTES],
}

impl Write for Message {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let room = MESSAGE_BYTES - 1 - self.len;
        let fits = text.floor_char_boundary(room.min(text.len()));
        // A zero would end the text for C.
        let bytes = text.bytes().take(fits).map(|byte| if byte == 0 { b' ' } else { byte });
        self.bytes[self.len..].iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
        self.len += fits;
        Ok(())
    }
}

thread_local! {
    static LAST: RefCell<Message> = const { RefCell::new(Message { count: 0, len: 0, bytes: [0; MESSAGE_BYTES] }) };
}

/// Keeps the words of a failure for this thread; in a handler of signals that has interrupted just this, none.
#[cold]
pub(crate) fn say(code: Code, words: Arguments<'_>) -> Code {
    LAST.with(|last| {
        let Ok(mut last) = last.try_borrow_mut() else { return };
        (last.count, last.len) = (last.count.wrapping_add(1), 0);
        // It takes all, and cuts what is too long.
        let _ = last.write_fmt(words);
        let end = last.len;
        last.bytes[end] = 0;
    });
    code
}

/// The same of an error.
pub(crate) fn failed(error: impl Coded) -> Code {
    say(error.code(), format_args!("{error}"))
}

/// Words for a code, in a few words; the same for all calls. Static: it is never freed. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_error_text(code: i32) -> *const c_char {
    text_of(code).as_ptr()
}

/// What was wrong with the last call of this thread that returned a code below 0, in a sentence that names what it was
/// about; empty before there was one. Read or copy it at once: the next call of this thread that fails writes there,
/// and so do calls that have more to say of `ROHRPOST_NOTHING`, and the library before it calls a function of a module.
/// The place belongs to the thread: it is the same each time, never null, there until the thread ends, and no other
/// thread may read it. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_last_error() -> *const c_char {
    // Nothing of this thread writes there while C reads it, until the next call fails. Only an address: a handler of
    // signals may ask for it while a call writes.
    LAST.with(|last| last.as_ptr().wrapping_byte_add(std::mem::offset_of!(Message, bytes)).cast())
}

/// What was wrong with the last call that failed in this thread.
pub(crate) fn last_words() -> String {
    let words = |last: &Message| String::from_utf8_lossy(&last.bytes[..last.len]).into_owned();
    LAST.with(|last| last.try_borrow().map(|last| words(&last)).unwrap_or_default())
}

/// Says a line on the standard error, if there still is one.
pub(crate) fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// How often this thread has said something.
pub(crate) fn said() -> u32 {
    LAST.with(|last| last.try_borrow().map_or(0, |last| last.count))
}

/// Runs a call: what it returns becomes a code, and so does a panic.
#[inline(always)]
pub(crate) fn edge(call: impl FnOnce() -> Result<(), Code>) -> Code {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(())) => Code::Ok,
        Ok(Err(code)) => code,
        Err(panic) => bug(&*panic),
    }
}

#[cold]
fn bug(panic: &(dyn Any + Send)) -> Code {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic");
    say(Code::Bug, format_args!("a mistake in Rohrpost: {text}"))
}

/// A place for a result, which must be there.
pub(crate) fn place<'a, T>(out: Option<&'a mut MaybeUninit<T>>, what: &str) -> Result<&'a mut MaybeUninit<T>, Code> {
    out.ok_or_else(|| null(what))
}

/// What is pointed to, which must be there.
pub(crate) fn given<'a, T>(argument: Option<&'a T>, what: &str) -> Result<&'a T, Code> {
    argument.ok_or_else(|| null(what))
}

#[cold]
fn null(what: &str) -> Code {
    say(Code::NullPointer, format_args!("`{what}` is a null pointer"))
}

/// Bytes that C points to.
///
/// # Safety
/// `bytes` is null, or points to `len` bytes that nobody changes for `'a`.
pub(crate) unsafe fn bytes<'a>(bytes: *const c_void, len: usize, what: &str) -> Result<&'a [u8], Code> {
    match (bytes.is_null(), len) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(null(what)),
        (_, len) if isize::try_from(len).is_err() => {
            Err(say(Code::TooLarge, format_args!("`{what}`: {len} bytes are more than there can be")))
        }
        // SAFETY: not null, of a possible length, and the caller says that so many bytes are there.
        (false, len) => Ok(unsafe { std::slice::from_raw_parts(bytes.cast(), len) }),
    }
}

/// A text that C points to; none for a null pointer.
///
/// # Safety
/// `text` is null, or points to bytes that end with a zero, which nobody changes for `'a`.
pub(crate) unsafe fn text<'a>(text: *const c_char, what: &str) -> Result<Option<&'a str>, Code> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, and the caller says that a zero ends it.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| say(Code::Value, format_args!("`{what}` is not UTF-8: {text:?}")))
}

/// The same of one that must be there.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn needed_text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Code> {
    // SAFETY: the caller's promise is the same.
    unsafe { text(pointer, what) }?.ok_or_else(|| null(what))
}

/// How long C wants to wait: below 0 for ever.
pub(crate) fn waiting(timeout_ns: i64, spin_ns: u64) -> Waiting {
    let timeout = u64::try_from(timeout_ns).ok().map(Duration::from_nanos);
    let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
    Waiting { spin: Duration::from_nanos(spin_ns), deadline }
}

/// Writes bytes and a zero into a buffer of C's.
///
/// # Safety
/// `buffer` is null, or has room for `size` bytes.
pub(crate) unsafe fn bytes_to(bytes: &[u8], buffer: *mut c_char, size: usize) -> Result<(), Code> {
    if buffer.is_null() {
        return Err(null("buffer"));
    }
    if size <= bytes.len() {
        let need = bytes.len() + 1;
        return Err(say(Code::SmallBuffer, format_args!("a buffer of {size} bytes; {need} are needed")));
    }
    // SAFETY: so many bytes are there, and one more, and C's memory is not Rust's.
    unsafe {
        std::ptr::copy_nonoverlapping(bytes.as_ptr(), buffer.cast(), bytes.len());
        buffer.add(bytes.len()).write(0);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{LAST, edge, last_words, rohrpost_last_error, say};
    use crate::code::Code;

    #[test]
    fn a_call_in_a_handler_that_has_interrupted_another_ones_failure_ends_with_its_code() {
        let before = say(Code::Value, format_args!("before"));
        assert_eq!((before, last_words().as_str()), (Code::Value, "before"));
        LAST.with_borrow_mut(|_| {
            assert_eq!(edge(|| Err(say(Code::Full, format_args!("in the handler")))), Code::Full);
            assert!(!rohrpost_last_error().is_null());
        });
        assert_eq!(last_words(), "before");
        // SAFETY: a zero ends it, and nothing is said meanwhile.
        let text = unsafe { std::ffi::CStr::from_ptr(rohrpost_last_error()) };
        assert_eq!(text, c"before");
    }
}
