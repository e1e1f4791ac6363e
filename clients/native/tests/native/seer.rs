//! Follows pictures in place, and looks at the numbers beside them when it likes.

use crate::eye::PICTURE;
use rohrpost_native::schema::Description;
use rohrpost_native::{
    Around, FollowRate, FollowedData, ModuleError, Moment, NativeContext, NativeInterface, NativeModule, NativeStream,
    StayingBytes,
};
use std::sync::mpsc::Sender;
use std::time::Duration;

/// A picture that it saw.
pub(crate) struct Seen {
    pub(crate) sequence: u32,
    pub(crate) len: usize,
    pub(crate) first: u8,
    pub(crate) last: u8,
    pub(crate) is_in_place: bool,
    /// The newest number then.
    pub(crate) counted: Option<u8>,
}

pub(crate) fn interface() -> NativeInterface {
    let (name, class) = ("Seer".into(), "seer".into());
    let description = Description { name, class, text: String::new(), functions: Vec::new(), data: Vec::new() };
    NativeInterface { description, parameters: Vec::new(), settings: Vec::new() }
}

pub(crate) struct Seer {
    pictures: usize,
    numbers: Option<NativeStream>,
    seen: Sender<Seen>,
}

impl Seer {
    pub(crate) fn make(
        context: &mut NativeContext<'_>,
        seen: Sender<Seen>,
    ) -> Result<Box<dyn NativeModule>, ModuleError> {
        let pictures = context.follow("eye.0", "picture", FollowRate::Records)?;
        Ok(Box::new(Self { pictures, numbers: None, seen }))
    }
}

impl NativeModule for Seer {
    fn received(&mut self, context: &mut NativeContext<'_>, data: &FollowedData<'_>) -> Result<(), ModuleError> {
        assert_eq!((data.follow, data.item.number), (self.pictures, PICTURE));
        let place = data.place.as_ref().ok_or_else(|| ModuleError::new("a record has a place"))?;
        let is_in_place =
            std::ptr::eq(place.address().as_ptr(), data.value.as_ptr()) && place.len() == data.value.len();
        let numbers = match &mut self.numbers {
            Some(numbers) => numbers,
            none => {
                let opened = context.stream("eye.0", "count", Duration::from_secs(10), false)?;
                none.insert(opened.ok_or_else(|| ModuleError::new("its pictures are there, so it is described"))?)
            }
        };
        let counted = numbers.newest()?.map(|record| match record.bytes {
            StayingBytes::Ring(place) => place.len() as u8,
            StayingBytes::Journal(bytes) => bytes.len() as u8,
        });
        assert!(!matches!(numbers.around(Moment::Ns(1))?, Around::Records { .. }), "nothing is so old");
        // Width, then the length in three bytes.
        let pixels = &data.value[4..];
        let seen = Seen {
            sequence: data.sequence,
            len: pixels.len(),
            first: pixels[0],
            last: pixels[pixels.len() - 1],
            is_in_place,
            counted,
        };
        // The test has seen enough, perhaps.
        let _ = self.seen.send(seen);
        Ok(())
    }
}
