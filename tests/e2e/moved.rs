//! A module moves to another computer by its `node =` alone: the demo's mapper, beside the scanner and away from it.

use crate::harness::{Place, lacks_namespaces};

/// What a demo says of its map, and of the scans that the other node of its mapper got.
#[derive(Debug)]
struct Mapped {
    /// Scans that the mapper read, and that went to `brain`.
    scans: u64,
    sent: u64,
    mapped: u64,
    free: u64,
    occupied: u64,
}

impl Mapped {
    /// Runs the demo with its mapper on a node; none where there are no namespaces.
    fn on(place: &Place, text: &str) -> Option<Self> {
        let config = place.write("nodes.toml", text);
        let config = config.to_str().unwrap();
        place.say(&["check", config]).ok();
        let said = place.say(&["demo", "--nodes", "3", "--config", config, "--seconds", "10", "--no-gui", "--quiet"]);
        if lacks_namespaces(&said.err) {
            return None;
        }
        assert_eq!(said.code, Some(0), "{said:?}");
        assert!(said.out.contains("lost without a cause: 0\n"), "{}", said.out);
        // Its subscriptions would be packages of its class.
        assert!(!said.out.lines().any(|line| line.starts_with("mapper ")), "it reads streams: {}", said.out);
        let map = said.out.lines().find_map(|line| line.strip_prefix("map: ")).unwrap();
        let [scans, _, mapped, _, free, occupied] = numbers(map)[..] else { panic!("{map}") };
        let way = said.out.lines().find(|line| line.starts_with("laser.0/scan ") && line.contains("→ brain"));
        let sent = numbers(way.unwrap().split_once("brain").unwrap().1)[0];
        Some(Self { scans, sent, mapped, free, occupied })
    }

    /// Whether the map is one of all scans, and the walls in it are thin.
    fn assert_good(&self, node: &str) {
        let Self { scans, sent, mapped, free, occupied } = self;
        assert!(*sent > 30 && scans * 10 >= sent * 9, "{node}: it reads all that is written: {self:?}");
        assert!(mapped * 10 >= scans * 9, "{node}: for each scan there is odometry: {self:?}");
        assert!(*occupied > 50 && free / occupied > 10, "{node}: {self:?}");
    }
}

fn numbers(text: &str) -> Vec<u64> {
    let words = text.split(|c: char| !c.is_ascii_digit()).filter(|word| !word.is_empty());
    words.map(|word| word.parse().unwrap()).collect()
}

#[test]
fn the_mapper_moves_to_another_node_by_one_line() {
    let place = Place::new();
    place.copy("config/building.map");
    let there = include_str!("../../config/demo-nodes.toml");
    let on = |node: &str| format!("name = \"mapper.0\"\nnode = \"{node}\"\n");
    let here = there.replacen(&on("brain"), &on("base"), 1);
    assert_eq!(here.lines().zip(there.lines()).filter(|(here, there)| here != there).count(), 1);
    let Some(here) = Mapped::on(&place, &here) else { return };
    let Some(there) = Mapped::on(&place, there) else { return };
    here.assert_good("beside the scanner");
    there.assert_good("on another node");
    // With poses of other times walls would be thicker.
    let walls = |of: &Mapped| of.occupied as f64 / of.free as f64;
    assert!((0.6..=1.7).contains(&(walls(&there) / walls(&here))), "{here:?}, {there:?}");
    place.assert_empty();
}
