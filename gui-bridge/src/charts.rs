//! How packages flow: three charts with one series, and one colour, for each class.

use crate::palette;
use crate::scene::{Scene, entity};
use crate::state::ChartClass;
use rerun::{Scalars, SeriesLines};

impl Scene {
    /// Packages of `class` a second, and how many were lost since the start.
    pub fn traffic(&mut self, class: &str, rate_per_s: f64, losses_total: u64) {
        let known = self.class(class);
        if !std::mem::replace(&mut known.flows, true) {
            let colour = palette::series(known.index);
            for chart in ["packages", "losses"] {
                self.series(&[chart, class], class, colour, 1.5);
            }
        }
        self.log(entity(&["packages", class]), &Scalars::single(rate_per_s));
        self.log(entity(&["losses", class]), &Scalars::single(losses_total as f64));
    }

    /// From posting to reading, microseconds: the median and what 99 of 100 packages stay below.
    pub fn latency(&mut self, class: &str, p50_us: f64, p99_us: f64) {
        let known = self.class(class);
        if !std::mem::replace(&mut known.times, true) {
            let colour = palette::series(known.index);
            self.series(&["latency", class, "p99"], &format!("{class} p99"), colour, 1.5);
            self.series(&["latency", class, "p50"], &format!("{class} p50"), palette::muted(colour), 1.0);
        }
        self.log(entity(&["latency", class, "p50"]), &Scalars::single(p50_us));
        self.log(entity(&["latency", class, "p99"]), &Scalars::single(p99_us));
    }

    fn class(&mut self, class: &str) -> &mut ChartClass {
        let index = self.charts.classes.len();
        self.charts.classes.entry(class.into()).or_insert(ChartClass { index, flows: false, times: false })
    }

    /// How a curve looks.
    pub(crate) fn series(&mut self, parts: &[&str], name: &str, colour: palette::Rgb, width: f32) {
        let line = SeriesLines::new().with_names([name]).with_colors([colour]).with_widths([width]);
        self.log_static(entity(parts), &line);
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::TestScene;

    #[test]
    fn a_class_is_styled_once_and_drawn_each_time() {
        let mut drawing = TestScene::new();
        for second in 0..10 {
            drawing.at_s(second);
            drawing.scene.traffic("laser", 40.0, second);
            drawing.scene.latency("laser", 12.0, 30.0);
        }
        let rows = drawing.rows();
        for entity in ["/packages/laser", "/losses/laser", "/latency/laser/p50", "/latency/laser/p99"] {
            assert_eq!(rows[entity], 10 + 1, "{entity}");
        }
    }
}
