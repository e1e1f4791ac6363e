//! Values written as bytes: what bodies of packages and records are made of (`docs/src/wire.md`). An encoder remembers
//! its first failure, so that C asks once, at the end.

use crate::code::Code;
use crate::edge::{bytes, edge, given, place, say};
use serde::Serialize;
use std::ffi::{c_char, c_void};
use std::mem::MaybeUninit;

/// Writes values one behind the other into bytes of the caller's.
#[repr(C)]
pub struct Encoder {
    /// Where they go.
    pub bytes: *mut u8,
    /// Bytes that there are.
    pub room: usize,
    /// Bytes that are written.
    pub len: usize,
    /// A code: how it went until now. Once it is not `ROHRPOST_OK`, nothing more is written.
    pub state: i32,
}

impl Encoder {
    /// How many bytes were written, if all values were.
    pub(crate) fn whole(&self) -> Result<usize, Code> {
        match self.state {
            state if state == Code::Ok as i32 => Ok(self.len),
            state if state == Code::SmallBuffer as i32 => {
                Err(say(Code::SmallBuffer, format_args!("the values do not fit into {} bytes", self.room)))
            }
            _ => Err(say(Code::Value, format_args!("a value that cannot be: a character, a text, or a null pointer"))),
        }
    }

    fn append(&mut self, write: impl FnOnce(&mut [u8]) -> Option<usize>) {
        if self.state != Code::Ok as i32 {
            return;
        }
        let left = self.room.saturating_sub(self.len);
        let room = match self.bytes.is_null() {
            // An encoder of zeros, which C may make.
            true => &mut [][..],
            // SAFETY: `rohrpost_encode` was given so many bytes, which are the caller's alone; those behind `len` are
            // left.
            false => unsafe { std::slice::from_raw_parts_mut(self.bytes.wrapping_add(self.room - left), left) },
        };
        match write(room) {
            Some(len) => self.len += len,
            None => self.state = Code::SmallBuffer as i32,
        }
    }
}

/// To write into these bytes.
pub(crate) fn encoder(bytes: &mut [u8]) -> Encoder {
    Encoder { bytes: bytes.as_mut_ptr(), room: bytes.len(), len: 0, state: Code::Ok as i32 }
}

fn put<T: Serialize>(encoder: Option<&mut Encoder>, value: T) {
    let written = |room: &mut [u8]| postcard::to_slice(&value, room).ok().map(|written| written.len());
    if let Some(encoder) = encoder {
        encoder.append(written);
    }
}

/// Begins to write values into `room` bytes. Any thread, as for all functions of encoders and decoders: they belong to
/// the caller, and need no end.
///
/// # Safety
/// `bytes` is null, or points to `room` bytes, which are the encoder's until it is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_encode(bytes: *mut c_void, room: usize) -> Encoder {
    // A slice has an address, also one of no bytes.
    let none = std::ptr::NonNull::dangling().as_ptr();
    let (bytes, room) = if bytes.is_null() { (none, 0) } else { (bytes.cast(), room.min(isize::MAX as usize)) };
    Encoder { bytes, room, len: 0, state: Code::Ok as i32 }
}

/// How many bytes were written, or `ROHRPOST_SMALL_BUFFER` when they did not fit, `ROHRPOST_VALUE` when a value cannot
/// be.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_encoded(encoder: Option<&Encoder>, len: Option<&mut MaybeUninit<usize>>) -> Code {
    edge(|| {
        let (encoder, out) = (given(encoder, "encoder")?, place(len, "len")?);
        out.write(encoder.len);
        encoder.whole().map(drop)
    })
}

/// Writes true or false; also whether an option has a value, which follows then.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_bool(encoder: Option<&mut Encoder>, value: bool) {
    put(encoder, value);
}

/// Writes a whole number from 0, of 8 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_u8(encoder: Option<&mut Encoder>, value: u8) {
    put(encoder, value);
}

/// Writes a whole number from 0, of 16 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_u16(encoder: Option<&mut Encoder>, value: u16) {
    put(encoder, value);
}

/// Writes a whole number from 0, of 32 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_u32(encoder: Option<&mut Encoder>, value: u32) {
    put(encoder, value);
}

/// Writes a whole number from 0, of 64 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_u64(encoder: Option<&mut Encoder>, value: u64) {
    put(encoder, value);
}

/// Writes a whole number with a sign, of 8 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_i8(encoder: Option<&mut Encoder>, value: i8) {
    put(encoder, value);
}

/// Writes a whole number with a sign, of 16 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_i16(encoder: Option<&mut Encoder>, value: i16) {
    put(encoder, value);
}

/// Writes a whole number with a sign, of 32 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_i32(encoder: Option<&mut Encoder>, value: i32) {
    put(encoder, value);
}

/// Writes a whole number with a sign, of 64 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_i64(encoder: Option<&mut Encoder>, value: i64) {
    put(encoder, value);
}

/// Writes a number with a fraction, of 32 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_f32(encoder: Option<&mut Encoder>, value: f32) {
    put(encoder, value);
}

/// Writes a number with a fraction, of 64 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_f64(encoder: Option<&mut Encoder>, value: f64) {
    put(encoder, value);
}

/// Writes a whole number from 0, of 128 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_u128(encoder: Option<&mut Encoder>, high: u64, low: u64) {
    put(encoder, u128::from(high) << 64 | u128::from(low));
}

/// Writes a whole number with a sign, of 128 bits.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_i128(encoder: Option<&mut Encoder>, high: i64, low: u64) {
    put(encoder, i128::from(high) << 64 | i128::from(low));
}

/// Writes a character by its number in Unicode.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_char(encoder: Option<&mut Encoder>, value: u32) {
    match (encoder, char::from_u32(value)) {
        (encoder, Some(character)) => put(encoder, character),
        (Some(encoder), None) => encoder.state = Code::Value as i32,
        (None, None) => {}
    }
}

/// Writes the number of a variant; its fields follow.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_variant(encoder: Option<&mut Encoder>, variant: u32) {
    put(encoder, variant);
}

/// Writes how many elements a list has; they follow.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_put_length(encoder: Option<&mut Encoder>, length: usize) {
    put(encoder, length);
}

/// Writes bytes, behind how many they are.
///
/// # Safety
/// `value` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_put_bytes(encoder: Option<&mut Encoder>, value: *const c_void, len: usize) {
    let Some(encoder) = encoder else { return };
    // SAFETY: the caller's promise.
    match unsafe { bytes(value, len, "value") } {
        Ok(value) => {
            put(Some(encoder), value.len());
            encoder.append(|room| {
                room.get_mut(..value.len())?.copy_from_slice(value);
                Some(value.len())
            });
        }
        Err(code) => encoder.state = code as i32,
    }
}

/// Writes a text of `len` bytes, which are UTF-8.
///
/// # Safety
/// `value` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_put_text(encoder: Option<&mut Encoder>, value: *const c_char, len: usize) {
    let Some(encoder) = encoder else { return };
    // SAFETY: the caller's promise.
    match unsafe { bytes(value.cast(), len, "value") }.map(std::str::from_utf8) {
        Ok(Ok(text)) => put(Some(encoder), text),
        Ok(Err(_)) => encoder.state = Code::Value as i32,
        Err(code) => encoder.state = code as i32,
    }
}
