//! Values written straight into a record.

use postcard::ser_flavors::{Flavor, Size};
use rohrpost_schema::{Members, Type};
use serde::Serialize;
use std::ops::Range;

/// Bytes of the longest length, 7 bits in each.
const LENGTH_BYTES_MAX: usize = usize::BITS.div_ceil(7) as usize;

/// Why a value is not in the record.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum EncodeError {
    /// So many bytes it would take.
    TooLarge(usize),
    /// It does not end with an empty field of bytes.
    NotEmpty,
    /// Postcard says no.
    Postcard(postcard::Error),
}

/// Writes a value to the front of `body`; how many bytes it took.
pub(super) fn put<T: Serialize>(value: &T, body: &mut [u8]) -> Result<usize, EncodeError> {
    match postcard::to_slice(value, body) {
        Ok(written) => Ok(written.len()),
        Err(error) => Err(explain(value, 0, error)),
    }
}

/// Writes a value of which the last field is bytes, and empty, with `len` bytes there; where they lie. What they are
/// stays open.
pub(super) fn put_open<T: Serialize>(value: &T, len: usize, body: &mut [u8]) -> Result<Range<usize>, EncodeError> {
    let front = postcard::serialize_with_flavor(value, Front { body: &mut *body, at: 0, ended_empty: false });
    // In place of the length 0.
    let more = || postcard::serialize_with_flavor(&len, Size::default()).map_or(0, |bytes| bytes - 1);
    let front = front.map_err(|error| explain(value, more().saturating_add(len), error))?;
    open_behind(front.ok_or(EncodeError::NotEmpty)?, len, body)
}

/// The same of a value that is postcard already.
pub(super) fn put_open_bytes(value: &[u8], len: usize, body: &mut [u8]) -> Result<Range<usize>, EncodeError> {
    let [front @ .., 0] = value else { return Err(EncodeError::NotEmpty) };
    let room = open_behind(front.len(), len, body)?;
    body[..front.len()].copy_from_slice(front);
    Ok(room)
}

/// Puts a length behind so many bytes; where these bytes are to lie.
fn open_behind(front: usize, len: usize, body: &mut [u8]) -> Result<Range<usize>, EncodeError> {
    let mut length = [0; LENGTH_BYTES_MAX];
    let length = postcard::to_slice(&len, &mut length).map_err(EncodeError::Postcard)?;
    let from = front + length.len();
    let end = from.saturating_add(len);
    if end > body.len() {
        return Err(EncodeError::TooLarge(end));
    }
    body[front..from].copy_from_slice(length);
    Ok(from..end)
}

/// Whether the last thing in a value of this type is bytes.
pub(super) fn ends_with_bytes(ty: &Type) -> bool {
    match ty {
        Type::Bytes => true,
        Type::Tuple(elements) => elements.last().is_some_and(ends_with_bytes),
        Type::Struct(named) => match &named.members {
            Members::None => false,
            Members::One(field) => ends_with_bytes(&field.ty),
            Members::Tuple(fields) | Members::Fields(fields) => {
                fields.last().is_some_and(|field| ends_with_bytes(&field.ty))
            }
        },
        _ => false,
    }
}

#[cold]
fn explain<T: Serialize>(value: &T, more: usize, error: postcard::Error) -> EncodeError {
    match (error, postcard::serialize_with_flavor(value, Size::default())) {
        (postcard::Error::SerializeBufferFull, Ok(len)) => EncodeError::TooLarge(len.saturating_add(more)),
        (error, _) => EncodeError::Postcard(error),
    }
}

/// Writes as postcard's own slice does, and notes whether the last thing written was bytes, and none of them.
struct Front<'b> {
    body: &'b mut [u8],
    at: usize,
    ended_empty: bool,
}

impl Flavor for Front<'_> {
    /// Bytes but for the length 0 at the end; none when the last thing was something else.
    type Output = Option<usize>;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        let room = self.body.get_mut(self.at..).and_then(|rest| rest.get_mut(..bytes.len()));
        room.ok_or(postcard::Error::SerializeBufferFull)?.copy_from_slice(bytes);
        self.at += bytes.len();
        self.ended_empty = bytes.is_empty();
        Ok(())
    }

    fn finalize(self) -> postcard::Result<Self::Output> {
        Ok(self.at.checked_sub(1).filter(|_| self.ended_empty))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_schema::{Bytes, Schema};

    #[derive(serde::Serialize, Schema)]
    struct Frame {
        width_px: u32,
        pixels: Bytes,
    }

    #[derive(serde::Serialize, Schema)]
    struct Framed(bool, Frame);

    #[test]
    fn a_value_filled_in_place_has_the_bytes_of_one_written_whole() {
        for len in [0, 1, 127, 128, 300, 16_384] {
            let pixels: Vec<u8> = (0..len).map(|at| at as u8).collect();
            let whole =
                postcard::to_stdvec(&Framed(true, Frame { width_px: 300, pixels: pixels.clone().into() })).unwrap();
            let mut body = vec![0xee; whole.len()];
            let front = Framed(true, Frame { width_px: 300, pixels: Bytes::default() });
            let room = put_open(&front, len, &mut body).unwrap();
            body[room.clone()].copy_from_slice(&pixels);
            assert_eq!((&body, room.end), (&whole, whole.len()), "{len}");
            assert_eq!(put_open(&front, len, &mut body[1..]), Err(EncodeError::TooLarge(whole.len())), "{len}");
            let front = postcard::to_stdvec(&front).unwrap();
            let mut body = vec![0xee; whole.len()];
            assert_eq!(put_open_bytes(&front, len, &mut body), Ok(room.clone()), "{len}");
            body[room].copy_from_slice(&pixels);
            assert_eq!(body, whole, "{len}");
            let short = put_open_bytes(&front, len, &mut body[1..]);
            assert_eq!(short, Err(EncodeError::TooLarge(whole.len())), "{len}");
        }
    }

    #[test]
    fn what_is_not_empty_or_no_bytes_is_not_filled_in_place() {
        let mut body = [0; 64];
        let one = Frame { width_px: 0, pixels: vec![0].into() };
        assert_eq!(put_open(&one, 3, &mut body), Err(EncodeError::NotEmpty));
        assert_eq!(put_open(&Vec::<u8>::new(), 3, &mut body), Err(EncodeError::NotEmpty));
        assert_eq!(put_open(&(), 3, &mut body), Err(EncodeError::NotEmpty));
        assert_eq!(put_open_bytes(&[7, 1, 0xee], 3, &mut body), Err(EncodeError::NotEmpty));
        for (ty, ends) in [
            (Frame::schema(), true),
            (Framed::schema(), true),
            (<(u8, Bytes)>::schema(), true),
            (<(Bytes, u8)>::schema(), false),
            (<Option<Bytes>>::schema(), false),
            (String::schema(), false),
        ] {
            assert_eq!(ends_with_bytes(&ty), ends, "{ty:?}");
        }
    }

    #[test]
    fn a_value_that_is_too_large_says_how_large_it_is() {
        let mut body = [0; 8];
        assert_eq!(put(&7u8, &mut body), Ok(1));
        assert_eq!(put(&"nine byte", &mut body), Err(EncodeError::TooLarge(10)));
    }
}
