//! What a drawn channel holds.

/// A message of Foxglove that a value is drawn as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Transform,
    Pose,
    Poses,
    Points,
    Image,
    Compressed,
    Log,
}

impl Kind {
    pub(crate) const ALL: [Self; 7] =
        [Self::Transform, Self::Pose, Self::Poses, Self::Points, Self::Image, Self::Compressed, Self::Log];

    /// Whether it has a place in the world.
    pub(crate) const fn is_in_space(self) -> bool {
        matches!(self, Self::Transform | Self::Pose | Self::Poses | Self::Points)
    }

    /// Foxglove's name for it, without its package.
    pub(crate) const fn message_name(self) -> &'static str {
        match self {
            Self::Transform => "FrameTransform",
            Self::Pose => "PoseInFrame",
            Self::Poses => "PosesInFrame",
            Self::Points => "PointCloud",
            Self::Image => "RawImage",
            Self::Compressed => "CompressedImage",
            Self::Log => "Log",
        }
    }

    /// The last part of the topic of such a channel, behind that of what it is drawn of.
    pub(crate) const fn suffix(self) -> &'static str {
        match self {
            Self::Transform => "transform",
            Self::Pose => "pose",
            Self::Poses => "poses",
            Self::Points => "points",
            Self::Image => "image",
            Self::Compressed => "compressed",
            Self::Log => "log",
        }
    }
}
