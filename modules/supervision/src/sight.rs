//! Whether a scan may be believed.

use core::f64::consts::TAU;

/// One sweep of a range scanner. Beam `i` points to `start_rad + i * step_rad` in the scanner's frame, x forward.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// When it was taken, at the earliest, ns of the monotonic clock.
    pub taken_ns: u64,
    /// Direction of the first beam, radians.
    pub start_rad: f64,
    /// From one beam to the next, radians; negative when the scanner turns clockwise.
    pub step_rad: f64,
    /// Readings of this length and more mean that nothing came back, metres.
    pub range_max_m: f64,
    /// Distances, metres. Below or equal to 0, or not a number: no reading.
    pub ranges_m: &'a [f32],
    /// Distances from which on something that moves may come, by beam, metres; see [`crate::Walls`]. Of a beam without
    /// one, or with a smaller one than its reading: from the reading on.
    pub moving_m: &'a [f32],
}

/// Beams further apart than this leave room for what a robot must not touch, radians.
const STEP_MAX_RAD: f64 = 0.1;

impl Scan<'_> {
    /// Whether the beams are an even fan, close together, of one turn at most.
    fn is_fan(&self) -> bool {
        let (step_rad, gaps) = (libm::fabs(self.step_rad), self.ranges_m.len().saturating_sub(1) as f64);
        let is_turn = step_rad > 0.0 && step_rad <= STEP_MAX_RAD && gaps * step_rad <= TAU + STEP_MAX_RAD;
        is_turn && self.start_rad.is_finite() && self.range_max_m.is_finite() && self.range_max_m > 0.0
    }

    /// Whether a beam has told anything.
    pub(crate) fn is_reading(range_m: f32) -> bool {
        range_m > 0.0
    }
}

/// Why a scan is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoSight {
    /// As old as the last one, or older.
    #[error("the scan is not newer than the last one")]
    Repeated,
    /// Older than scans may be.
    #[error("the scan is too old")]
    Old,
    /// Fewer than half of its beams have a reading.
    #[error("fewer than half of the beams have a reading")]
    Blind,
    /// Directions or the greatest range are no numbers, or beams are so far apart that a post stands between them.
    #[error("the scan's directions or range are none that can be used")]
    Malformed,
    /// The very readings of the last one, while the robot moved.
    #[error("the scanner repeats its readings while the robot moves")]
    Frozen,
}

/// Looks at each scan as it comes.
#[derive(Clone, Debug)]
pub struct Sight {
    age_max_ns: u64,
    last: Option<Last>,
}

#[derive(Clone, Debug)]
struct Last {
    taken_ns: u64,
    readings: Option<u64>,
    is_frozen: bool,
}

impl Sight {
    /// A scan older than this is none, ns.
    pub fn new(age_max_ns: u64) -> Self {
        Self { age_max_ns, last: None }
    }

    /// Looks at a scan that came now. `moved`: whether the robot may have moved since the last one.
    ///
    /// # Errors
    /// Why it is none; the one before stays what it was.
    pub fn look(&mut self, now_ns: u64, scan: &Scan<'_>, moved: bool) -> Result<(), NoSight> {
        if self.last.as_ref().is_some_and(|last| scan.taken_ns <= last.taken_ns) {
            return Err(NoSight::Repeated);
        }
        if self.is_old(now_ns, scan.taken_ns) {
            return Err(NoSight::Old);
        }
        if !scan.is_fan() {
            return Err(NoSight::Malformed);
        }
        let valid = scan.ranges_m.iter().filter(|range_m| Scan::is_reading(**range_m)).count();
        if valid == 0 || valid * 2 < scan.ranges_m.len() {
            return Err(NoSight::Blind);
        }
        let readings = digest(scan);
        let same = self.last.as_ref().filter(|last| readings.is_some() && last.readings == readings);
        // Once frozen, it is so until it shows something else: a standing robot sees the same again and again.
        let is_frozen = same.is_some_and(|last| moved || last.is_frozen);
        self.last = Some(Last { taken_ns: scan.taken_ns, readings, is_frozen });
        if is_frozen { Err(NoSight::Frozen) } else { Ok(()) }
    }

    /// When the scan was taken with which the next one is compared, ns.
    pub fn last_taken_ns(&self) -> Option<u64> {
        self.last.as_ref().map(|last| last.taken_ns)
    }

    /// A person has looked: the next scan is compared with none.
    pub fn reset(&mut self) {
        self.last = None;
    }

    /// Whether a scan taken then is too old now.
    pub fn is_old(&self, now_ns: u64, taken_ns: u64) -> bool {
        now_ns.saturating_sub(taken_ns) > self.age_max_ns
    }
}

/// FNV-1a over the bits of the readings that hit something, a word at a time: equal readings have equal digests, and
/// noise makes others. None if nothing is near enough to be hit: then all scans are equal.
fn digest(scan: &Scan<'_>) -> Option<u64> {
    let is_hit = |range_m: &&f32| Scan::is_reading(**range_m) && f64::from(**range_m) < scan.range_max_m;
    let add = |hash: u64, range_m: &f32| (hash ^ u64::from(range_m.to_bits())).wrapping_mul(0x100_0000_01b3);
    let mut hits = scan.ranges_m.iter().filter(is_hit).peekable();
    hits.peek()?;
    Some(hits.fold(0xcbf2_9ce4_8422_2325, add))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLISECOND_NS: u64 = 1_000_000;

    fn scan(taken_ms: u64, ranges_m: &[f32]) -> Scan<'_> {
        Scan {
            taken_ns: taken_ms * MILLISECOND_NS,
            start_rad: 0.0,
            step_rad: 0.1,
            range_max_m: 8.0,
            ranges_m,
            moving_m: &[],
        }
    }

    fn looked(sight: &mut Sight, now_ms: u64, scan: &Scan<'_>, moved: bool) -> Result<(), NoSight> {
        sight.look(now_ms * MILLISECOND_NS, scan, moved)
    }

    #[test]
    fn a_repeated_an_old_and_a_blind_scan_are_none() {
        let mut sight = Sight::new(300 * MILLISECOND_NS);
        assert_eq!(looked(&mut sight, 100, &scan(50, &[1.0, 2.0]), false), Ok(()));
        assert_eq!(looked(&mut sight, 120, &scan(50, &[1.5, 2.0]), false), Err(NoSight::Repeated));
        assert_eq!(looked(&mut sight, 451, &scan(150, &[1.5, 2.0]), false), Err(NoSight::Old));
        for blind in [&[][..], &[f32::NAN, 0.0, 1.0], &[-1.0]] {
            assert_eq!(looked(&mut sight, 460, &scan(450, blind), false), Err(NoSight::Blind), "{blind:?}");
        }
        let broken = [
            Scan { step_rad: 0.0, ..scan(450, &[1.0, 2.0]) },
            Scan { step_rad: 1.5, ..scan(450, &[1.0, 2.0]) },
            Scan { step_rad: f64::NAN, ..scan(450, &[1.0, 2.0]) },
            Scan { range_max_m: f64::INFINITY, ..scan(450, &[1.0, 2.0]) },
            scan(450, &[1.0; 70]),
        ];
        for broken in broken {
            assert_eq!(looked(&mut sight, 460, &broken, false), Err(NoSight::Malformed), "{broken:?}");
        }
        assert_eq!(
            looked(&mut sight, 460, &scan(450, &[8.0, 9.0, 0.0]), false),
            Ok(()),
            "nothing came back: a reading"
        );
    }

    #[test]
    fn the_same_readings_of_a_moving_robot_are_frozen_until_others_come() {
        let mut sight = Sight::new(300 * MILLISECOND_NS);
        let (wall, door) = ([1.0, 2.0], [1.0, 2.5]);
        assert_eq!(looked(&mut sight, 10, &scan(10, &wall), true), Ok(()));
        assert_eq!(looked(&mut sight, 20, &scan(20, &wall), false), Ok(()), "it stands");
        assert_eq!(looked(&mut sight, 30, &scan(30, &wall), true), Err(NoSight::Frozen));
        assert_eq!(looked(&mut sight, 40, &scan(40, &wall), false), Err(NoSight::Frozen), "it stands because of that");
        assert_eq!(looked(&mut sight, 50, &scan(50, &door), true), Ok(()));
        for ms in [60, 70, 80] {
            assert_eq!(looked(&mut sight, ms, &scan(ms, &[8.0, 8.0]), true), Ok(()), "a hall shows nothing");
        }
    }
}
