//! Types that come with Rohrpost, which code takes from there.

use rohrpost::schema::Type;
use rohrpost::types;

/// A name in Rust's `rohrpost::types`, and whether a description is of that type.
type Standard = (&'static str, fn(&Type) -> bool);

const ALL: [Standard; 9] = [
    ("Image", Type::is::<types::Image>),
    ("ImageFormat", Type::is::<types::ImageFormat>),
    ("LaserScan", Type::is::<types::LaserScan>),
    ("OccupancyGrid", Type::is::<types::OccupancyGrid>),
    ("Odometry", Type::is::<types::Odometry>),
    ("PointCloud", Type::is::<types::PointCloud>),
    ("PointFormat", Type::is::<types::PointFormat>),
    ("Pose", Type::is::<types::Pose>),
    ("Twist", Type::is::<types::Twist>),
];

/// The name of a type that comes with Rohrpost, if this is it: another of the same name is not.
pub(super) fn name(ty: &Type, known: &str) -> Option<&'static str> {
    let own = known.strip_prefix("rohrpost.")?;
    ALL.iter().find(|(name, is)| *name == own && is(ty)).map(|(name, _)| *name)
}
