//! What is drawn while it is recorded, into the same file.

use super::TWICE_BYTES_MAX;
use super::drawer::{Drawer, DrawnMessage};
use crate::read::definitions::Definition;
use crate::shape::Shape;
use std::collections::BTreeMap;

/// A longer message of which nothing comes is the last one of its period that is decoded: a package of others may take
/// milliseconds.
const ANEW_BYTES_MAX: usize = 4 << 10;

/// That a recording has drawn channels beside what it records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrawnBeside {
    /// Of each channel the first message of every such time is drawn, by its stamp; of output lines each. Of one that
    /// is longer than 64 KiB a part is, or nothing, so that nothing long is in a file twice.
    pub period_ns: u64,
    /// Names of classes by their numbers: output lines say which module they are of.
    pub classes: BTreeMap<u8, String>,
}

/// Draws what is written to one file.
pub(crate) struct DrawingBeside {
    drawer: Drawer,
    period_ns: u64,
    channels: BTreeMap<u16, SampledChannel>,
}

/// A channel of which some messages are drawn.
struct SampledChannel {
    channel: Definition,
    /// Its messages are words, of which none is left out.
    is_each: bool,
    /// The period, counted from 1970, of the last message that was drawn.
    period: Option<u64>,
}

impl DrawingBeside {
    pub(crate) fn new(options: &DrawnBeside) -> Self {
        let DrawnBeside { period_ns, classes } = options;
        let drawer = Drawer::new(classes.clone(), Some(TWICE_BYTES_MAX));
        Self { drawer, period_ns: (*period_ns).max(1), channels: BTreeMap::new() }
    }

    /// Whether a channel was added that is drawn.
    pub(crate) fn knows(&self, id: u16) -> bool {
        self.channels.contains_key(&id)
    }

    /// Adds a channel of the file.
    pub(crate) fn add(&mut self, id: u16, channel: Definition) {
        if let Some(shape) = self.drawer.add(id, &channel) {
            self.channels.insert(id, SampledChannel { channel, is_each: shape == Shape::Line, period: None });
        }
    }

    /// What is drawn of a message of the file.
    pub(crate) fn draw(&mut self, id: u16, stamp_ns: u64, data: &[u8]) -> Vec<DrawnMessage> {
        let Some(sampled) = self.channels.get_mut(&id) else { return Vec::new() };
        let period = Some(stamp_ns / self.period_ns);
        if !sampled.is_each && sampled.period == period {
            return Vec::new();
        }
        let drawn = self.drawer.draw(id, &sampled.channel, stamp_ns, data).unwrap_or_default();
        // A long one of which nothing comes is not decoded again and again.
        if !drawn.is_empty() || data.len() > ANEW_BYTES_MAX {
            sampled.period = period;
        }
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::{MESSAGE_ENCODING, SCHEMA_ENCODING};
    use crate::read::definitions::SchemaText;
    use rohrpost_modules::types::{Bytes, Image, ImageFormat};
    use rohrpost_schema::Schema;
    use std::sync::Arc;

    const PERIOD_NS: u64 = 100;

    /// Postcard of a picture with so many rows; with fewer bytes than it says, nothing is drawn of it.
    fn picture(rows: u32, is_whole: bool) -> Vec<u8> {
        let picture = Image::empty(100, rows, ImageFormat::Rgb8);
        let bytes = picture.row_bytes * rows - u32::from(!is_whole);
        postcard::to_stdvec(&Image { pixels: Bytes(vec![7; bytes as usize]), ..picture }).unwrap()
    }

    #[test]
    fn a_long_message_of_which_nothing_comes_is_decoded_once_a_period() {
        let mut drawing = DrawingBeside::new(&DrawnBeside { period_ns: PERIOD_NS, classes: BTreeMap::new() });
        let data = Image::<Bytes>::schema().to_bytes();
        let schema = Arc::new(SchemaText::new("its type".into(), SCHEMA_ENCODING.into(), data));
        let (topic, message_encoding) = ("eye.0/sight".into(), MESSAGE_ENCODING.into());
        drawing.add(0, Definition { topic, message_encoding, schema, ..Definition::default() });
        for (at_ns, rows, is_whole, is_drawn, why) in [
            (0, 10, false, false, "a short one that contradicts itself"),
            (1, 10, true, true, "and the next one"),
            (2, 10, true, false, "one in a period"),
            (100, 1_000, false, false, "a long one that contradicts itself"),
            (101, 1_000, true, false, "was that of this period"),
            (102, 10, true, false, "whatever comes"),
            (200, 1_000, true, true, "and there is one in the next"),
        ] {
            let drawn = drawing.draw(0, at_ns, &picture(rows, is_whole));
            assert_eq!(!drawn.is_empty(), is_drawn, "at {at_ns}: {why}");
        }
    }
}
