//! How values of a type can be drawn, by its description.

use rohrpost_schema::{Members, Type};

/// What values of a type look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// A place and a heading in the plane.
    Pose,
    /// A pose, and how it changes.
    Odometry,
    /// Poses.
    Path,
    /// One sweep of a range scanner.
    Scan,
    /// Points in space.
    Points,
    /// A picture.
    Picture,
    /// A line of output.
    Line,
}

/// What a field must be.
#[derive(Clone, Copy)]
enum FieldWanted {
    Number,
    Numbers,
    Count,
    Bytes,
    Text,
    Word,
    Pose,
    OptionalPose,
}

impl FieldWanted {
    fn is(self, ty: &Type) -> bool {
        let is_pose = |ty: &Type| Shape::of(ty) == Some(Shape::Pose);
        match (self, ty) {
            (Self::Number, Type::F32 | Type::F64)
            | (Self::Count, Type::U32)
            | (Self::Bytes, Type::Bytes)
            | (Self::Text, Type::Text)
            | (Self::Word, Type::Enum { .. }) => true,
            (Self::Numbers, Type::List(element)) => Self::Number.is(element),
            (Self::Bytes, Type::List(element)) => **element == Type::U8,
            (Self::Pose, ty) => is_pose(ty),
            (Self::OptionalPose, Type::Option(some)) => is_pose(some),
            _ => false,
        }
    }
}

type KnownType = (&'static str, &'static [(&'static str, FieldWanted)], Shape);

/// Types by the names that their authors gave them, and the fields that are read. They may have others, too.
const KNOWN: [KnownType; 6] = [
    (
        "rohrpost.Pose",
        &[("x_m", FieldWanted::Number), ("y_m", FieldWanted::Number), ("heading_rad", FieldWanted::Number)],
        Shape::Pose,
    ),
    ("rohrpost.Odometry", &[("pose", FieldWanted::Pose)], Shape::Odometry),
    (
        "rohrpost.LaserScan",
        &[
            ("start_rad", FieldWanted::Number),
            ("step_rad", FieldWanted::Number),
            ("range_max_m", FieldWanted::Number),
            ("ranges_m", FieldWanted::Numbers),
            ("pose", FieldWanted::OptionalPose),
        ],
        Shape::Scan,
    ),
    (
        "rohrpost.PointCloud",
        &[
            ("columns", FieldWanted::Count),
            ("rows", FieldWanted::Count),
            ("format", FieldWanted::Word),
            ("points", FieldWanted::Bytes),
        ],
        Shape::Points,
    ),
    (
        "rohrpost.Image",
        &[
            ("width_px", FieldWanted::Count),
            ("height_px", FieldWanted::Count),
            ("row_bytes", FieldWanted::Count),
            ("format", FieldWanted::Word),
            ("pixels", FieldWanted::Bytes),
        ],
        Shape::Picture,
    ),
    (
        "OutputLine",
        &[("module", FieldWanted::Count), ("level", FieldWanted::Word), ("text", FieldWanted::Text)],
        Shape::Line,
    ),
];

impl Shape {
    /// Whether a part of such a value is one, too.
    pub(crate) const fn can_be_reduced(self) -> bool {
        matches!(self, Self::Scan | Self::Points | Self::Picture)
    }

    /// Of values of a type; none if they are not drawn.
    pub(crate) fn of(ty: &Type) -> Option<Self> {
        match ty {
            Type::Struct(named) => {
                let Members::Fields(fields) = &named.members else { return None };
                let has = |(name, wanted): &(&str, FieldWanted)| {
                    fields.iter().any(|field| field.name == *name && wanted.is(&field.ty))
                };
                let known = KNOWN.iter().find(|(name, wanted, _)| *name == named.name && wanted.iter().all(has));
                known.map(|(.., shape)| *shape)
            }
            Type::List(element) | Type::Array(_, element) => {
                (Self::of(element) == Some(Self::Pose)).then_some(Self::Path)
            }
            _ => None,
        }
    }
}
