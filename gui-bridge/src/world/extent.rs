//! How far the world goes, with a margin, in whole metres so that it is seldom drawn anew.

/// Free space around what there is, metres.
const MARGIN_M: f32 = 0.75;

/// The world's bounds so far.
#[derive(Default)]
pub(crate) struct Extent {
    frame: Option<Frame>,
    drawn: bool,
}

/// A rectangle along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    min: [f32; 2],
    max: [f32; 2],
}

impl Extent {
    /// Makes room for `point` and the margin around it.
    pub(crate) fn include(&mut self, point: [f32; 2]) {
        if !point.iter().all(|part| part.is_finite()) {
            return;
        }
        let around =
            Frame { min: point.map(|part| (part - MARGIN_M).floor()), max: point.map(|part| (part + MARGIN_M).ceil()) };
        let united = self.frame.map_or(around, |frame| frame.united(&around));
        if self.frame != Some(united) {
            self.frame = Some(united);
            self.drawn = false;
        }
    }

    /// Whether the world goes that far.
    pub(crate) fn contains(&self, point: [f32; 2]) -> bool {
        self.frame.is_some_and(|frame| (0..2).all(|axis| (frame.min[axis]..=frame.max[axis]).contains(&point[axis])))
    }

    /// The frame, if it has changed since this was asked last.
    pub(crate) fn grown(&mut self) -> Option<Frame> {
        let drawn = std::mem::replace(&mut self.drawn, true);
        self.frame.filter(|_| !drawn)
    }
}

impl Frame {
    fn united(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|axis| self.min[axis].min(other.min[axis])),
            max: std::array::from_fn(|axis| self.max[axis].max(other.max[axis])),
        }
    }

    /// The closed line around it.
    pub(crate) fn outline(&self) -> Vec<[f32; 2]> {
        let ([left, bottom], [right, top]) = (self.min, self.max);
        vec![[left, bottom], [right, bottom], [right, top], [left, top], [left, bottom]]
    }

    /// A scale in the lower left corner: its line, and the round number of metres that it is long.
    pub(crate) fn scale(&self) -> (Vec<[f32; 2]>, f32) {
        let (width, height) = (self.max[0] - self.min[0], self.max[1] - self.min[1]);
        let decade = 10f32.powf((width / 5.0).log10().floor());
        let metres = [5.0, 2.0].map(|step| step * decade).into_iter().find(|m| *m <= width / 5.0).unwrap_or(decade);
        let (inset, tick) = (width.min(height) * 0.03, width.min(height) * 0.012);
        let (left, y) = (self.min[0] + inset, self.min[1] + inset);
        let line = vec![[left, y + tick], [left, y], [left + metres, y], [left + metres, y + tick]];
        (line, metres)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_drawn_only_when_the_world_has_grown() {
        let mut extent = Extent::default();
        assert_eq!(extent.grown(), None, "nothing is known yet");
        extent.include([0.5, 0.5]);
        assert_eq!(extent.grown(), Some(Frame { min: [-1.0, -1.0], max: [2.0, 2.0] }));
        for point in [[0.6, 0.4], [f32::NAN, 9.0], [f32::INFINITY, 0.0]] {
            extent.include(point);
            assert_eq!(extent.grown(), None, "{point:?}");
        }
        extent.include([10.0, 0.0]);
        assert!(extent.grown().is_some());
        assert!(extent.contains([10.7, 0.0]) && !extent.contains([12.0, 0.0]));
    }

    #[test]
    fn the_scale_is_a_round_number_of_metres() {
        for (width, metres) in [(4.0, 0.5), (8.0, 1.0), (14.0, 2.0), (40.0, 5.0), (300.0, 50.0)] {
            let frame = Frame { min: [0.0, 0.0], max: [width, 10.0] };
            assert_eq!(frame.scale().1, metres, "{width} m wide");
        }
    }
}
