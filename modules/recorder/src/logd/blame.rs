//! Why values did not come to the recorder: what it can tell of its mailbox, its processor and its absence.

use super::sampler::Lost;
use rohrpost::Context;
use rohrpost_mailbox::{ClassTraffic, local};
use rohrpost_recording::{LossCause, Pace};

/// A value that did not come.
#[derive(Clone, Copy, Debug)]
pub(super) enum Omitted {
    /// In a ring of this node.
    Record,
    /// A record, written since an earlier process of the recorder ended.
    EarlierRecord,
    /// From a publisher on this node.
    NearPackage,
    /// From one on another node.
    FarPackage,
}

/// What the recorder knows of its own part in losses.
pub(super) struct Blame {
    /// Of the thread that takes values.
    pace: Pace,
    /// Packages that found no room in the recorder's mailbox, and are counted, or are no loss.
    refused: u64,
    /// What came last was not to be recorded.
    is_passing_over: bool,
}

impl Blame {
    pub(super) fn new() -> Self {
        Self { pace: Pace::of_this_thread(), refused: 0, is_passing_over: false }
    }

    /// Nothing waits to be taken, or soon will not.
    pub(super) fn begin_pace(&mut self) {
        self.pace.begin();
    }

    /// A value came while nothing is recorded.
    pub(super) fn pass_over(&mut self) {
        self.is_passing_over = true;
    }

    /// A value came that is to be recorded. Packages that found no room while others were passed over are no loss.
    pub(super) fn go_on(&mut self, refused: impl FnOnce() -> u64) {
        if std::mem::take(&mut self.is_passing_over) {
            self.refused = refused();
        }
    }

    /// The causes of these losses. `refused`: packages that found no room in the recorder's mailbox so far.
    pub(super) fn causes(
        &mut self,
        Lost { way, here }: Lost,
        what: Omitted,
        refused: impl FnOnce() -> u64,
    ) -> [(LossCause, u64); 2] {
        let elsewhere = match what {
            Omitted::Record => return [(LossCause::Way, way), (self.pace.cause(), here)],
            Omitted::EarlierRecord => return [(LossCause::Way, way), (LossCause::Away, here)],
            // Nothing is between a publisher of this node and the mailbox but the size of its slots.
            Omitted::NearPackage => LossCause::Long,
            Omitted::FarPackage => LossCause::Way,
        };
        let here = way.min(refused().saturating_sub(self.refused));
        self.refused += here;
        [(elsewhere, way - here), (self.pace.cause(), here)]
    }
}

/// Packages that the recorder's mailbox for data has lost.
pub(super) fn mailbox_losses(context: &Context) -> u64 {
    let mailbox = context.me().with_local(local::DATA);
    let seen = context.link().borrow().participant().node().look_at(mailbox);
    seen.map_or(0, |seen| seen.classes.iter().map(ClassTraffic::lost_in_all).fold(0, u64::saturating_add))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_blamed_on_the_way_the_absence_the_size_or_the_recorder_itself() {
        let mut blame = Blame::new();
        let own = [LossCause::Recorder, LossCause::Processor];
        for (way, here, what, refused, first, of_own) in [
            (3, 4, Omitted::Record, 0, (LossCause::Way, 3), 4),
            (5, 0, Omitted::FarPackage, 2, (LossCause::Way, 3), 2),
            (5, 0, Omitted::NearPackage, 2, (LossCause::Long, 5), 0),
            (5, 0, Omitted::NearPackage, 9, (LossCause::Long, 0), 5),
            (1, 0, Omitted::FarPackage, 9, (LossCause::Way, 0), 1),
        ] {
            let [told, (cause, count)] = blame.causes(Lost { way, here }, what, || refused);
            assert_eq!((told, count), (first, of_own), "{what:?}, {refused} refused");
            assert!(own.contains(&cause), "{cause:?}");
        }
        blame.pass_over();
        blame.go_on(|| 20);
        blame.go_on(|| 21);
        let told = blame.causes(Lost { way: 5, here: 0 }, Omitted::FarPackage, || 22);
        assert_eq!(told.map(|(_, count)| count), [3, 2], "twenty found no room while nothing was recorded");
        let told = blame.causes(Lost { way: 1, here: 2 }, Omitted::EarlierRecord, || 0);
        assert_eq!(told, [(LossCause::Way, 1), (LossCause::Away, 2)]);
    }
}
