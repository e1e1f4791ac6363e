//! Data on their way to a module.

use super::stream::Moment;
use super::subscribed::{Origin, Subscribed};
use super::unreadable::Unreadable;
use crate::common::DataHead;
use crate::journal::{JournalEvent, ModuleJournal, NotedOrigin};
use rohrpost_mailbox::{HeldRecord, Missed, Name, RecordPlace, Stamp, StreamId, local};
use rohrpost_schema::{Data, View};

/// Data that a subscription brought.
///
/// ```
/// use rohrpost_modules::runtime::{Received, Subscription, Unreadable};
/// use rohrpost_modules::types::Odometry;
///
/// fn speed_m_s(data: &Received<'_>, odometry: &Subscription<Odometry>) -> Result<Option<f64>, Unreadable> {
///     Ok(data.read(odometry)?.map(|odometry| odometry.twist.speed_m_s))
/// }
/// ```
pub struct Received<'a> {
    /// The module that published it.
    pub from: Name,
    /// Data number in its interface.
    pub number: u16,
    /// Mailbox it came to; 0 for a record of a stream, which comes to none.
    pub mailbox: u8,
    /// Time, number, misses. Of a stream: the lower bits of the record's sequence, and records lost so far;
    /// what a replica leaves out on purpose is not lost.
    pub head: DataHead,
    /// The value, postcard. That of a stream's record lies in its ring.
    pub value: &'a [u8],
    origin: Origin,
    /// The record, if it is one in a ring, and what was missed before it.
    record: Option<(&'a HeldRecord<'a>, Missed)>,
}

impl<'a> Received<'a> {
    pub(super) fn new(from: Name, number: u16, origin: Origin, head: DataHead, value: &'a [u8]) -> Self {
        let mailbox = match origin {
            Origin::Package { mailbox, .. } => mailbox,
            Origin::Stream { .. } => local::COMMANDS,
        };
        Self { from, number, mailbox, head, value, origin, record: None }
    }

    /// A subscription's value: this record, before which so much was missed.
    pub(super) fn held(self, record: &'a HeldRecord<'a>, missed: Missed) -> Self {
        Self { record: Some((record, missed)), ..self }
    }

    /// Records of its stream that were missed so far, by cause. For programs without a journal, as the recorder is: an
    /// exact replay does not know it, and says 0.
    #[doc(hidden)]
    pub fn missed(&self) -> Missed {
        self.record.map(|(_, missed)| missed).unwrap_or_default()
    }

    /// Where the value lies, if it is a stream's record: for programs in other languages that hand out a view of it.
    /// Once the module has looked, its writer may have the place.
    pub fn place(&self) -> Option<RecordPlace> {
        self.record.map(|(record, _)| record.at())
    }

    /// As this journal is to have it.
    pub(super) fn event(&self, journal: &ModuleJournal) -> JournalEvent<'a> {
        let DataHead { stamp_ns, sequence, missed, incarnation } = self.head;
        let (origin, is_recorded) = match self.origin {
            Origin::Package { mailbox, id } => (NotedOrigin::Package { mailbox, id }, false),
            Origin::Stream { id, stamp: Stamp { epoch, ns }, is_recorded } => {
                (NotedOrigin::Stream { id, epoch, ns }, is_recorded)
            }
        };
        let (from, number) = (self.from.raw(), self.number);
        let id = StreamId { name: self.from, number };
        let value = journal.record(id, sequence.into(), is_recorded, self.value);
        JournalEvent::Received { from, number, origin, stamp_ns, sequence, missed, incarnation, value }
    }

    /// Of a journal, with this value; none of another event.
    pub(super) fn of(event: &JournalEvent<'_>, value: &'a [u8]) -> Option<Self> {
        let JournalEvent::Received { from, number, origin, stamp_ns, sequence, missed, incarnation, .. } = *event
        else {
            return None;
        };
        let origin = match origin {
            NotedOrigin::Package { mailbox, id } => Origin::Package { mailbox, id },
            NotedOrigin::Stream { id, epoch, ns } => {
                Origin::Stream { id, stamp: Stamp { epoch, ns }, is_recorded: false }
            }
        };
        let head = DataHead { stamp_ns, sequence, missed, incarnation };
        Some(Self::new(Name::from_raw(from), number, origin, head, value))
    }

    /// When it was true, to look for in a stream ([`super::Stream::at`]); that of a record with its epoch.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Received, Stream, StreamReadError};
    /// # use rohrpost_modules::types::Pose;
    /// fn pose_then(data: &Received<'_>, poses: &mut Stream<Pose>) -> Result<Option<Pose>, StreamReadError> {
    ///     Ok(poses.at(data.moment())?.ok())
    /// }
    /// ```
    pub fn moment(&self) -> Moment {
        match self.origin {
            Origin::Package { .. } => Moment::Ns(self.head.stamp_ns),
            Origin::Stream { stamp, .. } => stamp.into(),
        }
    }

    /// The value, if it belongs to this subscription; none of what belongs to another.
    ///
    /// # Errors
    /// It belongs to it, and cannot be read.
    pub fn read<S: Subscribed>(&self, subscription: &S) -> Result<Option<S::Item>, Unreadable> {
        self.is_of(subscription).then(|| self.decode()).transpose()
    }

    /// The same with its bytes where they lie, which copies none of them.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Received, StreamSubscription, Unreadable};
    /// use rohrpost_modules::schema::View;
    ///
    /// fn look<T: View>(
    ///     data: &Received<'_>,
    ///     images: &StreamSubscription<T>,
    ///     see: impl Fn(T::View<'_>),
    /// ) -> Result<(), Unreadable> {
    ///     if let Some(image) = data.view(images)? {
    ///         see(image);
    ///     }
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// It belongs to it, and cannot be read.
    pub fn view<S: Subscribed>(&self, subscription: &S) -> Result<Option<<S::Item as View>::View<'a>>, Unreadable>
    where
        S::Item: View,
    {
        self.is_of(subscription).then(|| self.decode()).transpose()
    }

    /// The value, if it came to this mailbox, which takes data from all ([`super::Context::open_mailbox_to_all`]).
    ///
    /// ```
    /// # use rohrpost_modules::{runtime::{Received, Unreadable}, types::Pose};
    /// const POSES: u8 = 3;
    ///
    /// fn pose(data: &Received<'_>) -> Result<Option<Pose>, Unreadable> {
    ///     data.read_from(POSES)
    /// }
    /// ```
    ///
    /// # Errors
    /// It came there, and cannot be read.
    pub fn read_from<T: Data>(&self, mailbox: u8) -> Result<Option<T>, Unreadable> {
        let came = matches!(self.origin, Origin::Package { .. }) && self.mailbox == mailbox;
        came.then(|| self.decode()).transpose()
    }

    fn decode<V: serde::Deserialize<'a>>(&self) -> Result<V, Unreadable> {
        postcard::from_bytes(self.value).map_err(|error| Unreadable::new(self.from, self.number, error))
    }

    /// Whether it belongs to this subscription.
    ///
    /// ```
    /// # use rohrpost_modules::{runtime::{Received, Subscription}, types::Odometry};
    /// fn missed(data: &Received<'_>, odometry: &Subscription<Odometry>) -> u32 {
    ///     if data.is_of(odometry) { data.head.missed.into() } else { 0 }
    /// }
    /// ```
    pub fn is_of<S: Subscribed>(&self, subscription: &S) -> bool {
        subscription.brought(self.origin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::follow::Subscription;

    const HEAD: DataHead = DataHead { stamp_ns: 0, sequence: 0, missed: 0, incarnation: 0 };

    #[test]
    fn what_is_of_another_is_told_from_what_cannot_be_read() {
        let from = Name::new(1, 150, 0, 0);
        let read = |id: u16, mailbox: u8, value: &[u8]| {
            let received = Received::new(from, 3, Origin::Package { mailbox, id }, HEAD, value);
            received.read(&Subscription::<u16>::new(7, 2))
        };
        assert_eq!(read(7, 2, &[5]), Ok(Some(5)));
        assert_eq!(read(8, 2, &[0xff]), Ok(None));
        assert_eq!(read(7, 3, &[0xff]), Ok(None));
        let told = read(7, 2, &[0xff]).unwrap_err().to_string();
        assert!(told.starts_with("data 3 of 1.150.0.0 cannot be read: "), "{told}");
    }
}
