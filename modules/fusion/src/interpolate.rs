//! Values between two others.

use crate::angle::wrap_rad;

/// How much of the way from one record to the next has gone by at a time: 0 to 1, so that nothing can be extrapolated.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Share(f64);

impl Share {
    /// Of the time from `before_ns` to `after_ns`, what has gone by at `at_ns`; none if that lies outside.
    ///
    /// ```
    /// use rohrpost_fusion::Share;
    /// assert_eq!(Share::between(100, 125, 200).map(Share::get), Some(0.25));
    /// assert_eq!(Share::between(100, 201, 200), None);
    /// ```
    pub fn between(before_ns: u64, at_ns: u64, after_ns: u64) -> Option<Self> {
        let (gone_ns, whole_ns) = (at_ns.checked_sub(before_ns)?, after_ns.checked_sub(before_ns)?);
        if gone_ns > whole_ns {
            return None;
        }
        // Of no time, nothing has gone by.
        Some(Self(gone_ns as f64 / whole_ns.max(1) as f64))
    }

    /// 0 to 1.
    pub const fn get(self) -> f64 {
        self.0
    }

    /// The value that is nearer in time; the earlier one in the middle.
    pub fn nearer<'v, V>(self, from: &'v V, to: &'v V) -> &'v V {
        if self.0 > 0.5 { to } else { from }
    }
}

/// What has values in between. The derive of the same name writes it for structs, field by field:
///
/// ```
/// use rohrpost_fusion::{Interpolate, Share};
///
/// #[derive(Interpolate)]
/// #[interpolate(crate = rohrpost_fusion)] // not needed where `rohrpost` is
/// struct Arm {
///     reach_m: f64,
///     #[interpolate(heading)] // the short way round
///     heading_rad: f64,
///     #[interpolate(earlier)] // that of the earlier record
///     holds: Option<String>,
///     #[interpolate(nearer)] // that of the record that is nearer in time
///     grip: u8,
/// }
///
/// let from = Arm { reach_m: 1.0, heading_rad: 3.0, holds: None, grip: 1 };
/// let to = Arm { reach_m: 2.0, heading_rad: -3.0, holds: Some("cup".into()), grip: 2 };
/// let between = Arm::interpolate(&from, &to, Share::between(0, 3, 4).unwrap());
/// assert_eq!((between.reach_m, between.holds, between.grip), (1.75, None, 2));
/// assert!((between.heading_rad - (3.0 + 0.75 * (std::f64::consts::TAU - 6.0) - std::f64::consts::TAU)).abs() < 1e-12);
/// ```
///
/// Numbers with a fraction, vectors and points go in a straight line, rotations turn at a constant rate the short way.
/// What has no values in between must say where its value comes from:
///
/// ```compile_fail,E0277
/// # use rohrpost_fusion::Interpolate;
/// #[derive(Interpolate)]
/// #[interpolate(crate = rohrpost_fusion)]
/// struct Arm {
///     grip: u8, // write `#[interpolate(earlier)]` or `#[interpolate(nearer)]` before it
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no values in between",
    label = "no value in between",
    note = "write `#[interpolate(earlier)]` or `#[interpolate(nearer)]` before the field to take it from one record, \
            or `#[derive(Interpolate)]` before its type"
)]
pub trait Interpolate: Sized {
    /// The value so much of the way from one to the other.
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self;
}

/// An angle in radians that meets itself after a turn; `#[interpolate(heading)]` before a field asks for it.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no heading",
    note = "`#[interpolate(heading)]` is for an `f64` or `f32`, in radians"
)]
pub trait Heading: Sized {
    /// The heading so much of the short way round, within (-π, π]. Of two opposite ones the way goes counter-clockwise.
    fn turn(from: &Self, to: &Self, share: Share) -> Self;
}

impl Interpolate for f64 {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        from + share.get() * (to - from)
    }
}

impl Interpolate for f32 {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        f64::interpolate(&f64::from(*from), &f64::from(*to), share) as Self
    }
}

impl Heading for f64 {
    fn turn(from: &Self, to: &Self, share: Share) -> Self {
        wrap_rad(from + share.get() * wrap_rad(to - from))
    }
}

impl Heading for f32 {
    fn turn(from: &Self, to: &Self, share: Share) -> Self {
        f64::turn(&f64::from(*from), &f64::from(*to), share) as Self
    }
}

impl<T: Interpolate, const N: usize> Interpolate for [T; N] {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        std::array::from_fn(|index| T::interpolate(&from[index], &to[index], share))
    }
}
