//! Poses in the plane as motions in space.

use super::fields::ValueFields;
use super::proto::{Pose, Quaternion, Vector3};
use rohrpost_schema::Value;

/// A place and a heading; all finite.
#[derive(Clone, Copy)]
pub(crate) struct PlanePose {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
}

impl PlanePose {
    pub(crate) const ORIGIN: Self = Self { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 };

    pub(crate) fn of(value: Value) -> Option<Self> {
        let fields = ValueFields::of(value)?;
        let (x_m, y_m) = (fields.finite("x_m")?, fields.finite("y_m")?);
        Some(Self { x_m, y_m, heading_rad: fields.finite("heading_rad")? })
    }

    /// A point of this body's frame in the frame that the pose is given in.
    pub(crate) fn carry(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (sine, cosine) = self.heading_rad.sin_cos();
        (self.x_m + cosine * x_m - sine * y_m, self.y_m + sine * x_m + cosine * y_m)
    }

    pub(crate) fn translation(&self) -> Vector3 {
        Vector3 { x: self.x_m, y: self.y_m, z: 0.0 }
    }

    pub(crate) fn rotation(&self) -> Quaternion {
        let (sine, cosine) = (self.heading_rad / 2.0).sin_cos();
        Quaternion { x: 0.0, y: 0.0, z: sine, w: cosine }
    }

    pub(crate) fn in_space(&self) -> Pose {
        Pose { position: Some(self.translation()), orientation: Some(self.rotation()) }
    }
}
