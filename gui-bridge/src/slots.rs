//! Time slots and declared flows: what routers tell of them, beside what was planned.
//!
//! ```text
//!   slots/plan            a lane for each node over the cycle: its slots and synchronisation windows, guards dim
//!   slots/sent/NODE       first frames of the last used slots, when they were sent; the newest lowest
//!   slots/off/NODE        the farthest that one of them was off since told last, µs
//!   slots/counters/…/NODE what each node counts of its slots
//!   slots/flows/NODE n/…  a flow of the node: its slowest package so far, and its bound (dim), ms
//! ```

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::palette;
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, is};
use rerun::blueprint::{ContainerLike, Spatial2DView, TimeSeriesView, Vertical};
use rerun::{Boxes2D, LineStrips2D, Points2D};
use rohrpost::interfaces::{FlowState, FlowStates, SlotState, SlotUse};
use rohrpost::schema::{DataItem, Description, counters};
use rohrpost_config::{Flow, Installation, duration_decimal};
use rohrpost_network::Tdma;
use std::collections::HashMap;
use std::time::Duration;

/// Points of the view: the cycle, a lane and the gap below it.
const WIDTH: f32 = 1000.0;
const HEIGHT: f32 = 60.0;
const PITCH: f32 = 80.0;
/// What routers tell of: so many windows.
const ROWS: usize = 16;
/// Parts of the cycle that are marked.
const MARKS: u32 = 5;
/// Counters that grow where slots are not kept.
const WRONG: [&str; 7] = ["late", "skipped", "silent", "held", "overran", "behind", "synchronisations_missed"];
const FRAME: palette::Rgb = palette::ROBOT;

/// The tab of both views.
fn tab() -> Tab {
    Tab::own("Time slots", || {
        let chart =
            |name: &str, origin: &str| -> ContainerLike { TimeSeriesView::new(name).with_origin(origin).into() };
        let lanes = ["/slots/plan/**", "/slots/sent/**"];
        let cycle = Spatial2DView::new("The cycle: slots, and where their first frames were").with_contents(lanes);
        Vertical::new([
            cycle.into(),
            chart("First frames off their slots' beginnings, µs", "slots/off"),
            TimeSeriesView::new("Slots and cycles that were not as they should be, since start")
                .with_origin("slots/counters")
                .with_contents(WRONG.map(|counter| format!("/slots/counters/{counter}/**")))
                .into(),
            chart("Declared flows, ms: the slowest package so far, and the bound (dim)", "slots/flows"),
        ])
        .with_row_shares([4.0, 3.0, 3.0, 5.0])
        .with_name("Time slots")
    })
}

/// How nodes keep their slots.
#[derive(Default)]
pub(crate) struct Slots {
    /// Beginning of the last window that was told of, by node, ns.
    told_ns: HashMap<String, u64>,
}

impl View for Slots {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<SlotState>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let slots: SlotState = datum.read()?;
        let installation = datum.installation;
        let lane = installation.nodes.iter().position(|node| node.name == slots.node);
        let (Some(tdma), Some(lane)) = (&installation.tdma, lane) else { return Ok(()) };
        if scene.charts.is_first("slots/plan") {
            plan(scene, installation, tdma);
        }
        let places = slots.last.iter().enumerate().map(|(row, used)| place(tdma, lane, row, used));
        let frames = Points2D::new(places).with_colors([FRAME]).with_radii([2.5]);
        scene.log(entity(&["slots", "sent", &slots.node]), &frames);
        let off = ["slots", "off", &slots.node];
        if scene.charts.is_first(&off.join("/")) {
            scene.series(&off, &slots.node, palette::series(lane), 1.5);
        }
        for (counter, count) in counters(&slots) {
            scene.curve(&["slots", "counters", &counter.name, &slots.node], count as f64);
        }
        let told_ns = self.told_ns.entry(slots.node.clone()).or_default();
        let told = slots.last.iter().filter(|used| used.begin_ns > *told_ns).map(|used| used.off_ns);
        if let Some(off_ns) = told.max_by_key(|off_ns| off_ns.unsigned_abs()) {
            scene.curve(&off, off_ns as f64 / 1e3);
        }
        *told_ns = slots.last.last().map_or(*told_ns, |used| used.begin_ns);
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![tab()]
    }
}

/// Where the first frame of a window was: in its node's lane, at its position in the cycle.
fn place(tdma: &Tdma, lane: usize, row: usize, used: &SlotUse) -> [f32; 2] {
    let cycle_ns = ns(tdma.cycle).max(1);
    let at_ns = used.begin_ns.wrapping_add_signed(used.off_ns) % cycle_ns;
    [across(tdma, Duration::from_nanos(at_ns)), top(lane) + HEIGHT * (row as f32 + 0.5) / ROWS as f32]
}

fn top(lane: usize) -> f32 {
    lane as f32 * PITCH
}

fn across(tdma: &Tdma, at: Duration) -> f32 {
    (at.as_secs_f64() / tdma.cycle.as_secs_f64()) as f32 * WIDTH
}

fn ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// A window in which a node may send, from the beginning of the cycle; it ends with the guard.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Planned {
    lane: usize,
    offset: Duration,
    length: Duration,
}

/// Synchronisation windows of the masters, then slots.
fn planned(installation: &Installation, tdma: &Tdma) -> Vec<Planned> {
    let masters = installation.time.masters().iter().zip(0u32..).map(|(node, rank)| Planned {
        lane: usize::from(*node),
        offset: tdma.synchronisation * rank,
        length: tdma.synchronisation,
    });
    let slots = tdma.slots.iter();
    let slots = slots.map(|slot| Planned { lane: slot.node.into(), offset: slot.offset, length: slot.length });
    masters.chain(slots).collect()
}

fn plan(scene: &mut Scene, installation: &Installation, tdma: &Tdma) {
    let colour = |lane: usize| palette::muted(palette::series(lane));
    let planned = planned(installation, tdma);
    let sends = |planned: &Planned| planned.length.saturating_sub(tdma.guard);
    let boxes = |from: fn(&Planned, Duration) -> Duration, long: &dyn Fn(&Planned) -> Duration| {
        let corner = |one: &Planned| [across(tdma, one.offset + from(one, sends(one))), top(one.lane)];
        let size = |one: &Planned| [across(tdma, long(one)), HEIGHT];
        Boxes2D::from_mins_and_sizes(planned.iter().map(corner), planned.iter().map(size))
    };
    let lanes = planned.iter().map(|one| colour(one.lane));
    let slots = boxes(|_, _| Duration::ZERO, &sends).with_colors(lanes).with_radii([1.5]);
    scene.log_static(entity(&["slots", "plan", "slots"]), &slots);
    let guards = boxes(|_, sends| sends, &|one| one.length - sends(one));
    scene.log_static(entity(&["slots", "plan", "guards"]), &guards.with_colors([palette::AID]).with_radii([0.5]));
    let nodes = 0..installation.nodes.len();
    let places = nodes.clone().map(|lane| [-40.0, top(lane) + HEIGHT / 2.0]);
    let names = label(places, installation.nodes.iter().map(|node| node.name.clone()));
    scene.log_static(entity(&["slots", "plan", "nodes"]), &names.with_colors(nodes.map(palette::series)));
    let bottom = top(installation.nodes.len());
    let at = |mark: u32| tdma.cycle * mark / MARKS;
    let lines = (0..=MARKS).map(|mark| [[across(tdma, at(mark)), -10.0], [across(tdma, at(mark)), bottom + 20.0]]);
    let lines = LineStrips2D::new(lines).with_colors([palette::muted(palette::AID)]).with_radii([0.4]);
    scene.log_static(entity(&["slots", "plan", "marks"]), &lines);
    let times = (0..=MARKS).map(|mark| [across(tdma, at(mark)), bottom - 5.0]);
    let times = label(times, (0..=MARKS).map(|mark| duration_decimal(at(mark))));
    scene.log_static(entity(&["slots", "plan", "times"]), &times.with_colors([palette::AID]));
}

/// Words at places.
fn label(places: impl Iterator<Item = [f32; 2]>, words: impl Iterator<Item = String>) -> Points2D {
    Points2D::new(places).with_labels(words).with_show_labels(true).with_radii([0.1])
}

/// How late packages of declared flows were.
pub(crate) struct Flows;

impl View for Flows {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<FlowStates>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let node: FlowStates = datum.read()?;
        for (index, flow) in node.flows.iter().enumerate().filter(|(_, flow)| flow.packages > 0) {
            let place = format!("{} {index}", node.node);
            let [worst, bound] = ["worst", "bound"].map(|series| ["slots", "flows", &place, series]);
            if scene.charts.is_first(&place) {
                let what = if flow.carries.is_empty() { format!("{} B", flow.size) } else { flow.carries.clone() };
                let name = format!("{} → {}, {what}", flow.from, flow.to);
                let colour = palette::series(colour(datum.installation, flow));
                scene.series(&worst, &name, colour, 1.5);
                scene.series(&bound, &format!("{name}: bound"), palette::muted(colour), 1.0);
            }
            for (curve, ns) in [(&worst, flow.worst_ns), (&bound, flow.bound_ns)] {
                if let Some(ns) = ns {
                    scene.curve(curve, ns as f64 / 1e6);
                }
            }
        }
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![tab()]
    }
}

/// Colour of a flow, by its place in the configuration.
fn colour(installation: &Installation, flow: &FlowState) -> usize {
    let format = |name| installation.classes.format(name);
    let carries = |known: &Flow| known.carries.map(|carries| carries.to_string()).unwrap_or_default();
    let is_it = |known: &Flow| {
        let ends = format(known.from) == flow.from && format(known.to) == flow.to;
        ends && carries(known) == flow.carries && known.size == flow.size
    };
    installation.flows.iter().position(is_it).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;
    use rohrpost::interface::Interface;
    use rohrpost::interfaces::RouterInterface;
    use rohrpost::wire::append;
    use std::path::Path;

    const US: u64 = 1_000;
    /// System time of the beginning of a cycle of 5 ms.
    const CYCLE_NS: u64 = 1_790_000_000_000_000_000;

    fn demo() -> Installation {
        Installation::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo-tdma.toml")).unwrap()
    }

    fn used(slot: Option<u16>, begin_us: u64, off_us: i64) -> SlotUse {
        let begin_ns = CYCLE_NS + begin_us * US;
        SlotUse { slot, begin_ns, end_ns: begin_ns + 200 * US, off_ns: off_us * 1_000, by_kernel: true, datagrams: 1 }
    }

    /// Draws what the router of a node tells.
    fn draw<T: serde::Serialize>(drawing: &mut TestScene, view: &mut dyn View, data: &str, told: &T) {
        let installation = demo();
        let (mut bytes, description) = (Vec::new(), RouterInterface::description());
        append(&mut bytes, told).unwrap();
        let item = description.data_item(data).unwrap();
        assert!(view.wants(&description, item));
        let from = installation.router_of("base").unwrap();
        let datum = Datum { from, module: "router.0", item, installation: &installation, bytes: &bytes };
        view.draw(&mut drawing.scene, &datum).unwrap();
    }

    fn slots(last: Vec<SlotUse>) -> SlotState {
        SlotState { node: "brain".into(), used: 1, late: 2, scheduled: "deadline".into(), last, ..SlotState::default() }
    }

    #[test]
    fn a_frame_stands_in_its_lane_where_it_was_in_the_cycle() {
        let installation = demo();
        let tdma = installation.tdma.as_ref().unwrap();
        for (used, row, x, why) in [
            (used(Some(0), 1_000, 0), 0, 200.0, "at the beginning of its slot"),
            (used(Some(0), 1_000, 50), 15, 210.0, "later"),
            (used(None, 10_000, -5), 0, 999.0, "too early, so that it is in the cycle before"),
        ] {
            let [left, down] = place(tdma, 2, row, &used);
            assert!((left - x).abs() < 0.01, "{why}: {left}");
            assert!((top(2)..top(2) + HEIGHT).contains(&down), "{why}: {down}");
        }
    }

    #[test]
    fn each_slot_and_each_masters_window_is_planned_and_none_overlaps() {
        let installation = demo();
        let tdma = installation.tdma.as_ref().unwrap();
        let mut planned = planned(&installation, tdma);
        assert_eq!(planned.len(), tdma.slots.len() + 2);
        planned.sort_by_key(|one| one.offset);
        assert!(planned.windows(2).all(|two| two[0].offset + two[0].length <= two[1].offset), "{planned:?}");
    }

    #[test]
    fn the_plan_is_drawn_once_and_what_was_told_before_is_no_news() {
        let (mut drawing, mut view) = (TestScene::new(), Slots::default());
        let first = vec![used(None, 0, 3), used(Some(1), 2_200, -20)];
        draw(&mut drawing, &mut view, "slots", &slots(first.clone()));
        draw(&mut drawing, &mut view, "slots", &slots(first));
        let rows = drawing.rows();
        assert_eq!((rows["/slots/plan/slots"], rows["/slots/plan/guards"]), (1, 1));
        assert_eq!((rows["/slots/sent/brain"], rows["/slots/off/brain"]), (2, 1 + 1), "with its style");
        assert_eq!(WRONG.map(|counter| rows[&format!("/slots/counters/{counter}/brain")]), [2; WRONG.len()]);
    }

    #[test]
    fn flows_that_sent_something_are_drawn_with_their_bounds() {
        let flow = |packages, bound_ns| FlowState {
            from: "laser.0".into(),
            to: "pilot.0".into(),
            carries: String::new(),
            size: 800,
            packages,
            bound_ns,
            kept_worst_ns: bound_ns.map(|_| 4_000_000),
            worst_ns: Some(5_000_000),
            mean_ns: Some(1),
            p99_ns: Some(1),
            deadline_ns: 10_000_000,
            over_bound: bound_ns.map(|_| 0),
            kept_over_bound: bound_ns.map(|_| 0),
            over_deadline: 0,
            lost: Vec::new(),
        };
        let told =
            FlowStates { node: "base".into(), flows: vec![flow(3, Some(5_500_000)), flow(0, None), flow(3, None)] };
        let mut drawing = TestScene::new();
        (0..2).for_each(|_| draw(&mut drawing, &mut Flows, "flows", &told));
        let rows = drawing.rows();
        let of = |entity: &str| rows.get(&format!(r"/slots/flows/{entity}")).copied().unwrap_or(0);
        assert_eq!([of(r"base\ 0/worst"), of(r"base\ 0/bound")], [3, 3], "its style, then twice");
        assert_eq!([of(r"base\ 1/worst"), of(r"base\ 2/worst"), of(r"base\ 2/bound")], [0, 3, 1]);
    }
}
