//! Values read from bytes, as `encode` writes them. A decoder remembers its first failure, so that C asks once, at the
//! end.

use crate::code::Code;
use crate::edge::{edge, given, say};
use serde::Deserialize;
use std::ffi::{c_char, c_void};
use std::mem::MaybeUninit;

/// Reads values one behind the other. A value that is not there is 0, and all behind it.
#[repr(C)]
pub struct Decoder {
    /// What is not read yet.
    pub bytes: *const u8,
    /// How many these are.
    pub left: usize,
    /// A code: how it went until now. Once it is not `ROHRPOST_OK`, nothing more is read.
    pub state: i32,
}

impl Decoder {
    /// Whether what was read is not of its type, or something is left behind it.
    pub(crate) fn is_malformed(&self) -> bool {
        self.state != Code::Ok as i32 || self.left > 0
    }
}

/// Of what is not there: nothing can be read from it.
pub(crate) fn none() -> Decoder {
    Decoder { state: Code::Malformed as i32, ..decoder(&[]) }
}

/// To read these bytes.
pub(crate) fn decoder(bytes: &[u8]) -> Decoder {
    Decoder { bytes: bytes.as_ptr(), left: bytes.len(), state: Code::Ok as i32 }
}

fn get<'a, T: Deserialize<'a>>(decoder: Option<&mut Decoder>) -> Option<T> {
    let decoder = decoder.filter(|decoder| decoder.state == Code::Ok as i32)?;
    let left = match decoder.bytes.is_null() {
        // A decoder of zeros, which C may make.
        true => &[][..],
        // SAFETY: `rohrpost_decode` was given these bytes, which stay as they are while they are read; `left` are left.
        false => unsafe { std::slice::from_raw_parts(decoder.bytes, decoder.left) },
    };
    match postcard::take_from_bytes(left) {
        Ok((value, rest)) => {
            (decoder.bytes, decoder.left) = (rest.as_ptr(), rest.len());
            Some(value)
        }
        Err(_) => {
            decoder.state = Code::Malformed as i32;
            None
        }
    }
}

/// Begins to read values from `len` bytes.
///
/// # Safety
/// `bytes` is null, or points to `len` bytes, which stay as they are until all is read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_decode(bytes: *const c_void, len: usize) -> Decoder {
    let none = std::ptr::NonNull::dangling().as_ptr();
    let (bytes, left) =
        if bytes.is_null() { (none, 0) } else { (bytes.cast_mut().cast(), len.min(isize::MAX as usize)) };
    Decoder { bytes, left, state: Code::Ok as i32 }
}

/// Whether all was read, and nothing is left; else `ROHRPOST_MALFORMED`.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_decoded(decoder: Option<&Decoder>) -> Code {
    edge(|| {
        let Decoder { state, left, .. } = given(decoder, "decoder")?;
        match (*state == Code::Ok as i32, left) {
            (true, 0) => Ok(()),
            (true, left) => Err(say(Code::Malformed, format_args!("{left} bytes are left behind the values"))),
            (false, left) => {
                Err(say(Code::Malformed, format_args!("the bytes are not of this type, {left} before their end")))
            }
        }
    })
}

/// Reads true or false; also whether an option has a value, which follows then.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_bool(decoder: Option<&mut Decoder>) -> bool {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number from 0, of 8 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_u8(decoder: Option<&mut Decoder>) -> u8 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number from 0, of 16 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_u16(decoder: Option<&mut Decoder>) -> u16 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number from 0, of 32 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_u32(decoder: Option<&mut Decoder>) -> u32 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number from 0, of 64 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_u64(decoder: Option<&mut Decoder>) -> u64 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number with a sign, of 8 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_i8(decoder: Option<&mut Decoder>) -> i8 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number with a sign, of 16 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_i16(decoder: Option<&mut Decoder>) -> i16 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number with a sign, of 32 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_i32(decoder: Option<&mut Decoder>) -> i32 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number with a sign, of 64 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_i64(decoder: Option<&mut Decoder>) -> i64 {
    get(decoder).unwrap_or_default()
}

/// Reads a number with a fraction, of 32 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_f32(decoder: Option<&mut Decoder>) -> f32 {
    get(decoder).unwrap_or_default()
}

/// Reads a number with a fraction, of 64 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_f64(decoder: Option<&mut Decoder>) -> f64 {
    get(decoder).unwrap_or_default()
}

/// Reads a whole number from 0, of 128 bits: its lower half, and through `high` the upper one.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_u128(decoder: Option<&mut Decoder>, high: Option<&mut MaybeUninit<u64>>) -> u64 {
    let value: u128 = get(decoder).unwrap_or_default();
    if let Some(high) = high {
        high.write((value >> 64) as u64);
    }
    value as u64
}

/// Reads a whole number with a sign, of 128 bits: its lower half, and through `high` the upper one.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_i128(decoder: Option<&mut Decoder>, high: Option<&mut MaybeUninit<i64>>) -> u64 {
    let value: i128 = get(decoder).unwrap_or_default();
    if let Some(high) = high {
        high.write((value >> 64) as i64);
    }
    value as u64
}

/// Reads a character: its number in Unicode.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_char(decoder: Option<&mut Decoder>) -> u32 {
    get::<char>(decoder).unwrap_or_default().into()
}

/// Reads the number of a variant; its fields follow.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_variant(decoder: Option<&mut Decoder>) -> u32 {
    get(decoder).unwrap_or_default()
}

/// Reads how many elements a list has, if there may be so many: each takes `bytes_min` bytes at least, which is 1 or
/// more.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_length(decoder: Option<&mut Decoder>, bytes_min: usize) -> usize {
    let Some(decoder) = decoder else { return 0 };
    let length: usize = get(Some(decoder)).unwrap_or_default();
    if length <= decoder.left / bytes_min.max(1) {
        return length;
    }
    decoder.state = Code::Malformed as i32;
    0
}

/// Reads bytes: where they are, and through `len` how many. They are those of the decoder, not a copy.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_bytes(decoder: Option<&mut Decoder>, len: Option<&mut MaybeUninit<usize>>) -> *const u8 {
    let value: &[u8] = get(decoder).unwrap_or_default();
    if let Some(len) = len {
        len.write(value.len());
    }
    value.as_ptr()
}

/// Reads a text, which is UTF-8: where it is, and through `len` how many bytes. No zero ends it.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_get_text(
    decoder: Option<&mut Decoder>,
    len: Option<&mut MaybeUninit<usize>>,
) -> *const c_char {
    let value: &str = get(decoder).unwrap_or_default();
    if let Some(len) = len {
        len.write(value.len());
    }
    value.as_ptr().cast()
}
