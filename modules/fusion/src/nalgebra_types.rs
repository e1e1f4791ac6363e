//! Positions, rotations and motions of nalgebra.

use crate::angle::wrap_rad;
use crate::interpolate::{Interpolate, Share};
use nalgebra::{
    AbstractRotation, Isometry, Point, Quaternion, SVector, Translation, UnitComplex, UnitQuaternion, Vector3,
};

impl<const D: usize> Interpolate for SVector<f64, D> {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        from + (to - from) * share.get()
    }
}

impl<const D: usize> Interpolate for Point<f64, D> {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        Self::from(SVector::interpolate(&from.coords, &to.coords, share))
    }
}

impl<const D: usize> Interpolate for Translation<f64, D> {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        Self::from(SVector::interpolate(&from.vector, &to.vector, share))
    }
}

/// The short way round; of two opposite ones the way goes counter-clockwise.
impl Interpolate for UnitComplex<f64> {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        from * Self::new(share.get() * wrap_rad((from.inverse() * to).angle()))
    }
}

/// Slerp: about one axis at a constant rate, the short way. Between two opposite ones, the first component of the axis
/// that is not 0 is positive. So the result does not depend on which of its two quaternions a rotation has.
impl Interpolate for UnitQuaternion<f64> {
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        let turn = from.inverse() * to;
        let (cosine, axis) = shorter(turn.w, turn.imag());
        // Of half the angle that is turned: 0 to π/2, so nothing here divides by the sine of a half turn.
        let sine = axis.norm();
        if sine == 0.0 {
            return *from;
        }
        let half_rad = share.get() * sine.atan2(cosine);
        let part = Quaternion::from_parts(half_rad.cos(), axis * (half_rad.sin() / sine));
        Self::new_normalize(from.into_inner() * part)
    }
}

/// Of the two quaternions of a rotation, the one that turns by less than the other.
fn shorter(cosine: f64, axis: Vector3<f64>) -> (f64, Vector3<f64>) {
    let points_back = || axis.iter().find(|part| **part != 0.0).is_some_and(|part| *part < 0.0);
    if cosine < 0.0 || (cosine == 0.0 && points_back()) { (-cosine, -axis) } else { (cosine, axis) }
}

impl<R, const D: usize> Interpolate for Isometry<f64, R, D>
where
    R: Interpolate + AbstractRotation<f64, D>,
{
    fn interpolate(from: &Self, to: &Self, share: Share) -> Self {
        let translation = Translation::interpolate(&from.translation, &to.translation, share);
        Self::from_parts(translation, R::interpolate(&from.rotation, &to.rotation, share))
    }
}
