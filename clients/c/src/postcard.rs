//! Values as bytes: what bodies of packages and records are made of (`docs/src/wire.md`).
//!
//! Both directions remember their first failure, so that C asks once, at the end.

use crate::code::Code;
use crate::edge::{bytes, edge, given, place, say};
use serde::{Deserialize, Serialize};
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
        // SAFETY: `rohrpost_encode` was given so many bytes, which are the caller's alone; those behind `len` are left.
        let room = unsafe { std::slice::from_raw_parts_mut(self.bytes.wrapping_add(self.room - left), left) };
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

/// To read these bytes.
pub(crate) fn decoder(bytes: &[u8]) -> Decoder {
    Decoder { bytes: bytes.as_ptr(), left: bytes.len(), state: Code::Ok as i32 }
}

fn put<T: Serialize>(encoder: Option<&mut Encoder>, value: T) {
    let written = |room: &mut [u8]| postcard::to_slice(&value, room).ok().map(|written| written.len());
    if let Some(encoder) = encoder {
        encoder.append(written);
    }
}

fn get<'a, T: Deserialize<'a>>(decoder: Option<&mut Decoder>) -> Option<T> {
    let decoder = decoder.filter(|decoder| decoder.state == Code::Ok as i32)?;
    // SAFETY: `rohrpost_decode` was given these bytes, which stay as they are while they are read; `left` are left.
    let left = unsafe { std::slice::from_raw_parts(decoder.bytes, decoder.left) };
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
