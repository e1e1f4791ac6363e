use super::*;
use rerun::blueprint::components::{ColumnShare, ContainerKind, IncludedContent, RowShare, ViewOrigin};
use rerun::components::{Name, Position3D};
use rerun::external::re_sdk_types::blueprint::archetypes::{ContainerBlueprint, ViewBlueprint};
use rerun::log::Chunk;
use rerun::{Component, ComponentDescriptor};
use std::collections::BTreeMap;

/// A blueprint as a viewer gets it: what each of its entities has.
struct Sent(BTreeMap<String, Chunk>);

impl Sent {
    fn of(tabs: Vec<Tab>) -> Self {
        let builder = RecordingStreamBuilder::new("test");
        let messages = written(builder, |stream| send(stream, &Layout::new(tabs))).unwrap();
        let chunk = |message: &LogMsg| match message {
            LogMsg::ArrowMsg(store, batch) if store.is_blueprint() => Some(Chunk::from_arrow_msg(batch).unwrap()),
            _ => None,
        };
        Self(messages.iter().filter_map(chunk).map(|chunk| (chunk.entity_path().to_string(), chunk)).collect())
    }

    fn all<C: Component>(&self, entity: &str, descriptor: &ComponentDescriptor) -> Vec<C> {
        let batch = self.0.get(entity).and_then(|chunk| chunk.component_batch(descriptor.component, 0));
        batch.map(Result::unwrap).unwrap_or_default()
    }

    fn contents(&self, container: &str) -> Vec<String> {
        let contents = self.all::<IncludedContent>(container, &ContainerBlueprint::descriptor_contents());
        contents.into_iter().map(|content| content.0.as_str().to_owned()).collect()
    }

    /// The container that none contains.
    fn root(&self) -> String {
        let contained: Vec<String> = self.0.keys().flat_map(|entity| self.contents(entity)).collect();
        let is_root = |entity: &&String| entity.starts_with("/container/") && !contained.contains(*entity);
        let roots: Vec<&String> = self.0.keys().filter(is_root).collect();
        let [root] = roots[..] else { panic!("one root, not {roots:?}") };
        root.clone()
    }

    /// The kind of a container and the shares of what it contains, or the name of a view.
    fn words(&self, entity: &str) -> String {
        let names = self.all::<Name>(entity, &ViewBlueprint::descriptor_display_name());
        let kinds = self.all::<ContainerKind>(entity, &ContainerBlueprint::descriptor_container_kind());
        let columns = self.all::<ColumnShare>(entity, &ContainerBlueprint::descriptor_col_shares());
        let rows = self.all::<RowShare>(entity, &ContainerBlueprint::descriptor_row_shares());
        let shares = columns.iter().map(|share| share.0.0).chain(rows.iter().map(|share| share.0.0));
        let words = kinds.iter().map(ToString::to_string).chain(names.iter().map(ToString::to_string));
        words.chain(shares.map(|share| share.to_string())).collect::<Vec<_>>().join(" ")
    }

    /// A line for each container and view, below what contains it.
    fn outline(&self) -> String {
        self.lines_of(&self.root(), 0).join("\n")
    }

    fn lines_of(&self, entity: &str, depth: usize) -> Vec<String> {
        let own = format!("{:1$}{2}", "", 2 * depth, self.words(entity));
        let below = self.contents(entity);
        std::iter::once(own).chain(below.iter().flat_map(|content| self.lines_of(content, depth + 1))).collect()
    }

    /// The view of this name.
    fn view(&self, name: &str) -> &str {
        self.0.keys().find(|entity| self.words(entity) == name).unwrap()
    }
}

/// As several views of one datum each may have it.
#[test]
fn of_tabs_with_one_name_the_first_is_there() {
    let sent = Sent::of(["first", "second"].map(|origin| Tab::curves("Wheels", origin)).to_vec());
    assert_eq!(sent.outline().matches("Wheels").count(), 1);
    let origins = sent.all::<ViewOrigin>(sent.view("Wheels"), &ViewBlueprint::descriptor_space_origin());
    assert_eq!(origins.iter().map(|origin| origin.0.as_str()).collect::<Vec<_>>(), ["/first"]);
}

fn picture(name: &'static str) -> Tab {
    Tab::own(name, move || Spatial2DView::new(name)).beside()
}

#[test]
fn without_sensors_all_tabs_are_in_the_place_of_the_world() {
    let sent = Sent::of(vec![Tab::plane("Laser", &["/world/scan/**"]), Tab::curves("Wheels", "motion")]);
    assert_eq!(
        sent.outline(),
        "Horizontal 3 2
  Vertical 7 3
    Tabs
      World
      Laser
      Wheels
    Horizontal 3 1
      Modules
      Modules now
  Vertical 4 5 3 4
    Packages per second, by class
    Latency, µs: p99, and median (dim)
    Packages lost since start
    Output"
    );
}

#[test]
fn pictures_and_points_are_beside_the_world_and_charts_beside_them() {
    let points = Tab::space("Points", "/points/depth.0/points", &["/points/**"]).beside();
    let sent = Sent::of(vec![picture("camera.0 image"), Tab::plane("Laser", &["/world/scan/**"]), points]);
    assert_eq!(
        sent.outline(),
        "Vertical 7 3
  Horizontal 5 3 3
    Tabs
      World
      Laser
    Vertical
      Tabs
        camera.0 image
      Points
    Vertical 4 5 3
      Packages per second, by class
      Latency, µs: p99, and median (dim)
      Packages lost since start
  Horizontal 4 2 5
    Modules
    Modules now
    Output"
    );
}

#[test]
fn a_team_comes_before_the_world_and_its_timelines_beside_it() {
    let lanes = Tab::own("Modes", || StateTimelineView::new("Modes")).beside();
    let eye_m = [[4.0, -2.0, 6.0], [4.0, 3.0, 0.0]];
    let sent = Sent::of(vec![Tab::curves("Wheels", "motion"), Tab::floor("Team", "/space", Some(eye_m)), lanes]);
    assert_eq!(
        sent.outline(),
        "Horizontal 7 4
  Vertical 4 1
    Tabs
      Team
      World
      Wheels
      Vertical 4 5 3
        Packages per second, by class
        Latency, µs: p99, and median (dim)
        Packages lost since start
    Tabs
      Output
      Modules
      Modules now
  Vertical
    Tabs
      Modes"
    );
    let eye = format!("{}/EyeControls3D", sent.view("Team"));
    let place = sent.all::<Position3D>(&eye, &EyeControls3D::descriptor_position());
    assert_eq!(place, [eye_m[0].into()]);
}

#[test]
fn a_picture_of_another_node_has_its_delay_below_it() {
    let delay = EntityPath::from(vec!["delay".into(), "camera.0/image".into()]);
    let sent = Sent::of(vec![picture("camera.0 image").over_curves("both".into(), "Delay, ms".into(), delay)]);
    let cell = "    Vertical\n      Tabs\n        Vertical 3 1\n          camera.0 image\n          Delay, ms\n";
    assert!(sent.outline().contains(cell), "{}", sent.outline());
    let origins = sent.all::<ViewOrigin>(sent.view("Delay, ms"), &ViewBlueprint::descriptor_space_origin());
    assert_eq!(origins.iter().map(|origin| origin.0.as_str()).collect::<Vec<_>>(), [r"/delay/camera.0\/image"]);
}

#[test]
fn of_more_than_three_beside_the_world_the_first_share_a_cell() {
    for (names, column) in [
        (&["a"][..], "Tabs( a ) "),
        (&["a", "b"], "Tabs( a ) b "),
        (&["a", "b", "c"], "Tabs( a ) b c "),
        (&["a", "b", "c", "d", "e"], "Tabs( a b c ) d e "),
    ] {
        let sent = Sent::of(names.iter().map(|name| picture(name)).collect());
        let upper = &sent.contents(&sent.root())[0];
        let cells = sent.contents(&sent.contents(upper)[1]);
        let name = |view: &String| format!("{} ", sent.words(view));
        let cell = |cell: &String| match sent.contents(cell) {
            views if views.is_empty() => name(cell),
            views => format!("{}( {}) ", sent.words(cell), views.iter().map(name).collect::<String>()),
        };
        assert_eq!(cells.iter().map(cell).collect::<String>(), column);
    }
}

#[test]
fn space_is_seen_from_behind_its_origin() {
    let sent = Sent::of(vec![Tab::space("Points", "/points/depth.0/points", &["/points/**"]).beside()]);
    let eye = format!("{}/EyeControls3D", sent.view("Points"));
    let places = [EyeControls3D::descriptor_position(), EyeControls3D::descriptor_look_target()]
        .map(|descriptor| sent.all::<Position3D>(&eye, &descriptor));
    assert_eq!(places, [vec![EYE_M.into()], vec![EYE_TARGET_M.into()]]);
}
