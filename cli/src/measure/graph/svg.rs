//! The graph as a drawing. The library `layout` places the elements; this file draws them.

use super::parts::{Carries, Edge, Graph, Module};
use layout::core::base::Orientation;
use layout::core::color::Color;
use layout::core::format::{ClipHandle, RenderBackend};
use layout::core::geometry::{Point, get_size_for_str};
use layout::core::style::{LineStyleKind, StyleAttr};
use layout::std_shapes::shapes::{Arrow, Element, LineEndKind, ShapeKind};
use layout::topo::layout::VisualGraph;
use std::fmt::Write;

const FONT: usize = 14;
const LABEL_FONT: usize = 11;
/// Margin around the drawing.
const MARGIN: f64 = 12.0;
/// The library reserves a square for each letter; letters are narrower.
const LETTER: f64 = 0.62;

/// Colours that differ on white and on dark paper, also for readers with red-green colour blindness.
const DATA: u32 = 0x2a_6f_b5;
const COMMAND: u32 = 0xb5_43_2a;
const OUTPUT: u32 = 0x7a_7a_7a;
const REPLY: u32 = 0x5a_5a_8a;

pub(super) fn write(graph: &Graph, all: bool) -> String {
    let mut plan = VisualGraph::new(Orientation::LeftToRight);
    let edges: Vec<&Edge> = graph.drawn(all).collect();
    let in_use = |module: &&Module| {
        !module.is_left_out
            && (module.state != "tool" || edges.iter().any(|edge| [&edge.from, &edge.to].contains(&&module.module)))
    };
    let modules: Vec<&Module> = graph.modules.iter().filter(in_use).collect();
    let boxes: Vec<_> = modules.iter().map(|module| plan.add_node(box_of(graph, module))).collect();
    let place = |name: &str| modules.iter().position(|module| module.module == name).map(|at| boxes[at]);
    for edge in &edges {
        if let (Some(from), Some(to)) = (place(&edge.from), place(&edge.to)) {
            plan.add_edge(arrow_of(edge), from, to);
        }
    }
    let mut drawing = Drawing::default();
    // The library cannot draw an empty graph.
    if !modules.is_empty() {
        plan.do_it(false, false, false, &mut drawing);
    }
    drawing.finish(&graph.title())
}

fn box_of(graph: &Graph, module: &Module) -> Element {
    let below: String = graph.below(module).map(|line| format!("\n{line}")).collect();
    let text = format!("{}{below}", module.module);
    let fill = if module.is_down() { 0xf4_d9_d3 } else { 0xf1_f4_f8 };
    let look = StyleAttr::new(colour(0x33_3a_44), 1, Some(colour(fill)), 6, FONT);
    let size = get_size_for_str(&text, FONT);
    let size = Point::new(size.x * LETTER + 24.0, size.y * 1.2 + 14.0);
    Element::create(ShapeKind::new_box(&text), look, Orientation::LeftToRight, size)
}

fn arrow_of(edge: &Edge) -> Arrow {
    let (ink, dashed) = match edge.carries {
        Carries::Data | Carries::Stream => (DATA, LineStyleKind::Normal),
        Carries::Command => (COMMAND, LineStyleKind::Normal),
        Carries::Common => (COMMAND, LineStyleKind::Dashed),
        Carries::Reply => (REPLY, LineStyleKind::Dashed),
        Carries::Output => (OUTPUT, LineStyleKind::Normal),
    };
    // A rate ten times as high makes the line one point wider.
    let width = (1.0 + edge.packages_per_s.max(1.0).log10()).round() as usize;
    let look = StyleAttr::new(colour(ink), width, None, 0, LABEL_FONT);
    let text = edge.label();
    // The library reserves room for the text; the line writes it, and gets it as its property.
    Arrow::with_properties(LineEndKind::None, LineEndKind::Arrow, dashed, &text, &look, text.clone(), &None, &None)
}

/// The library's colours are 0xRRGGBBAA.
fn colour(rgb: u32) -> Color {
    Color::new(rgb << 8 | 0xff)
}

fn web(colour: Color) -> String {
    colour.to_web_color().chars().take(7).collect()
}

/// The drawing layer by layer, and its extent.
#[derive(Default)]
struct Drawing {
    arrows: String,
    boxes: String,
    texts: String,
    /// Least and greatest x and y.
    reach: Option<(f64, f64, f64, f64)>,
}

impl Drawing {
    fn reach(&mut self, x: f64, y: f64) {
        let (left, top, right, bottom) = self.reach.unwrap_or((x, y, x, y));
        self.reach = Some((left.min(x), top.min(y), right.max(x), bottom.max(y)));
    }

    /// The text of a box, with a bold first line.
    fn text(&mut self, at: Point, text: &str, look: &StyleAttr) {
        let lines = text.lines().count() as f64;
        let step = look.font_size as f64 * 1.2;
        for (n, line) in text.lines().enumerate() {
            let y = at.y + step * (n as f64 - (lines - 1.0) / 2.0) + look.font_size as f64 * 0.35;
            let weight = if n == 0 { " font-weight=\"bold\"" } else { "" };
            let _ = writeln!(
                self.texts,
                "<text x=\"{:.1}\" y=\"{y:.1}\" font-size=\"{}\" text-anchor=\"middle\" \
                fill=\"#1c2128\"{weight}>{}</text>",
                at.x,
                look.font_size,
                escaped(line)
            );
        }
    }

    /// A label on the middle of its line, in the line's colour, on its own background.
    fn label(&mut self, at: Point, text: &str, look: &StyleAttr) {
        let font = look.font_size as f64;
        let (wide, high) = (text.chars().count() as f64 * font * LETTER + 4.0, font * 1.3);
        let (left, top) = (at.x - wide / 2.0, at.y - high / 2.0);
        self.reach(left, top);
        self.reach(left + wide, top + high);
        let _ = writeln!(
            self.texts,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{wide:.1}\" height=\"{high:.1}\" fill=\"white\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"{font}\" text-anchor=\"middle\" fill=\"{}\">{}</text>",
            at.x,
            at.y + font * 0.35,
            web(look.line_color),
            escaped(text)
        );
    }

    fn finish(self, title: &str) -> String {
        let (left, top, right, bottom) = self.reach.unwrap_or_default();
        let (x, y) = (left - MARGIN, top - MARGIN);
        let (wide, high) = (right - left + 2.0 * MARGIN, bottom - top + 2.0 * MARGIN);
        let tip = |rgb: u32| {
            // One marker for each end of a line: renderers disagree about reversing a marker.
            let marker = |end: &str, shape: &str, at: u8| {
                format!(
                    "<marker id=\"{end}{rgb:06x}\" viewBox=\"0 0 10 8\" refX=\"{at}\" refY=\"4\" markerWidth=\"10\" \
                     markerHeight=\"8\" markerUnits=\"userSpaceOnUse\" orient=\"auto\"><path d=\"{shape}\" \
                     fill=\"#{rgb:06x}\"/></marker>\n"
                )
            };
            marker("end", "M0 0L10 4L0 8z", 9) + &marker("start", "M10 0L0 4L10 8z", 1)
        };
        let tips: String = [DATA, COMMAND, OUTPUT, REPLY].into_iter().map(tip).collect();
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{wide:.0}\" height=\"{high:.0}\" viewBox=\"{x:.1} \
             {y:.1} {wide:.1} {high:.1}\" font-family=\"sans-serif\">\n<title>{}</title>\n<defs>\n{tips}</defs>\n\
             <rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{wide:.1}\" height=\"{high:.1}\" fill=\"white\"/>\n{}{}{}</svg>",
            escaped(title),
            self.arrows,
            self.boxes,
            self.texts
        )
    }
}

impl RenderBackend for Drawing {
    fn draw_rect(&mut self, at: Point, size: Point, look: &StyleAttr, _: Option<String>, _: Option<ClipHandle>) {
        self.reach(at.x, at.y);
        self.reach(at.x + size.x, at.y + size.y);
        let fill = look.fill_color.map_or("none".into(), web);
        let _ = writeln!(
            self.boxes,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"{}\" fill=\"{fill}\" stroke=\"{}\"/>",
            at.x,
            at.y,
            size.x,
            size.y,
            look.rounded,
            web(look.line_color)
        );
    }

    /// Only the text of boxes: the lines write their own labels.
    fn draw_text(&mut self, at: Point, text: &str, look: &StyleAttr) {
        if look.font_size == FONT {
            self.text(at, text, look);
        }
    }

    fn draw_arrow(
        &mut self,
        path: &[(Point, Point)],
        dashed: bool,
        head: (bool, bool),
        look: &StyleAttr,
        label: Option<String>,
        _: &str,
    ) {
        let [(start, leaving), (arriving, next), rest @ ..] = path else { return };
        let pair = |a: &Point, b: &Point| format!("{:.1} {:.1}, {:.1} {:.1}", a.x, a.y, b.x, b.y);
        let mut line =
            format!("M {:.1} {:.1} C {:.1} {:.1}, {}", start.x, start.y, leaving.x, leaving.y, pair(arriving, next));
        for (control, point) in rest {
            let _ = write!(line, " S {}", pair(control, point));
        }
        path.iter().for_each(|(a, b)| [a, b].iter().for_each(|point| self.reach(point.x, point.y)));
        let ink = web(look.line_color);
        let tip = |end: &str| format!(" marker-{end}=\"url(#{end}{})\"", ink.trim_start_matches('#'));
        let start = if head.0 { tip("start") } else { String::new() };
        let end = if head.1 { tip("end") } else { String::new() };
        let dash = if dashed { " stroke-dasharray=\"5 4\"" } else { "" };
        let width = look.line_width;
        let _ = writeln!(
            self.arrows,
            "<path d=\"{line}\" fill=\"none\" stroke=\"{ink}\" stroke-width=\"{width}\"{dash}{start}{end}/>"
        );
        if let Some(label) = label {
            self.label(middle(path), &label, look);
        }
    }

    fn draw_line(&mut self, start: Point, stop: Point, look: &StyleAttr, _: Option<String>) {
        self.draw_arrow(&[(start, start), (stop, stop)], false, (false, false), look, None, "");
    }

    /// We use no round or clipped shape.
    fn draw_circle(&mut self, _: Point, _: Point, _: &StyleAttr, _: Option<String>) {}

    fn create_clip(&mut self, _: Point, _: Point, _: usize) -> ClipHandle {
        0
    }
}

/// The middle of a line made of Bézier curves, by its length. The first pair of points is the start and its control
/// point, each other pair is an incoming control point and an end; the outgoing control point mirrors the incoming one.
fn middle(path: &[(Point, Point)]) -> Point {
    let mut points = Vec::new();
    let (mut from, mut leaving) = path[0];
    for (arriving, to) in &path[1..] {
        for step in 0..=16 {
            let t = f64::from(step) / 16.0;
            let mix = |a: f64, b: f64, c: f64, d: f64| {
                let u = 1.0 - t;
                u * u * u * a + 3.0 * u * u * t * b + 3.0 * u * t * t * c + t * t * t * d
            };
            points.push(Point::new(mix(from.x, leaving.x, arriving.x, to.x), mix(from.y, leaving.y, arriving.y, to.y)));
        }
        (from, leaving) = (*to, Point::new(2.0 * to.x - arriving.x, 2.0 * to.y - arriving.y));
    }
    let length = |pair: &[Point]| (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y);
    let mut left = points.windows(2).map(length).sum::<f64>() / 2.0;
    for pair in points.windows(2) {
        left -= length(pair);
        if left <= 0.0 {
            return pair[1];
        }
    }
    from
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(modules: usize, edges: &[(usize, usize)]) -> Graph {
        let module = |n: usize| Module {
            module: format!("m.{n}"),
            node: "main".into(),
            aliases: Vec::new(),
            state: "on".into(),
            priority: 9,
            is_left_out: false,
        };
        let edge = |(from, to): &(usize, usize)| Edge {
            from: format!("m.{from}"),
            to: format!("m.{to}"),
            carries: if from < to { Carries::Data } else { Carries::Command },
            what: "<scan>".into(),
            packages: 20,
            packages_per_s: 10.0,
            bytes_per_s: 80.0,
            refused: 0,
        };
        Graph {
            installation: "test".into(),
            node: "main".into(),
            nodes: vec!["main".into()],
            silent: Vec::new(),
            interval_s: 2.0,
            modules: (0..modules).map(module).collect(),
            edges: edges.iter().map(edge).collect(),
        }
    }

    #[test]
    fn any_graph_can_be_drawn() {
        // Circles, self loops, parallel edges, unconnected modules: a linear congruence produces all of them.
        let mut seed = 1u64;
        let mut number = move |below: usize| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as usize % below
        };
        for modules in 0..14 {
            for round in 0..8 {
                let edges: Vec<_> = (0..modules * round / 3).map(|_| (number(modules), number(modules))).collect();
                let drawn = write(&graph(modules, &edges), true);
                assert!(drawn.ends_with("</svg>") && !drawn.contains("NaN"), "{modules} {edges:?}");
                assert_eq!(drawn.matches("rx=").count(), modules, "{edges:?}");
                assert_eq!(drawn.matches("&lt;scan&gt; 10/s").count(), edges.len(), "{edges:?}");
            }
        }
    }
}
