//! `data`: all that modules publish, as packages and as streams, with rates, sizes and subscribers.

use crate::harness::{OUTPUT, Place, probe, simulated, wait};
use serde_json::Value;

fn item<'a>(listing: &'a Value, module: &str, item: &str) -> &'a Value {
    let items = listing["items"].as_array().unwrap();
    let found = items.iter().find(|it| it["module"] == module && it["item"] == item);
    found.unwrap_or_else(|| panic!("no {item} of {module}: {listing}"))
}

#[test]
fn each_item_has_its_rate_size_age_and_subscribers() {
    let modules = [
        OUTPUT,
        &probe("probe.0", "rate-hz = 50.0, blob-hz = 50.0", ""),
        &probe("probe.1", "hears = \"probe.0\"", "calls = [\"probe.0\"]"),
    ];
    let (place, mut launch, _robot) = Place::running(&modules);
    let listing = wait("its subscriber is fed", || {
        let listing = place.say(&["data", "--seconds", "0.5", "--json"]).json();
        (item(&listing, "probe.0", "beat")["subscribers"] == serde_json::json!(["probe.1"])).then_some(listing)
    });
    let beat = item(&listing, "probe.0", "beat");
    assert_eq!((&beat["as"], &beat["node"]), (&"package".into(), &"main".into()));
    assert!(beat["rate_hz"].as_f64().is_some_and(|rate_hz| rate_hz > 0.0), "{beat}");
    assert!(beat["bytes"].as_f64().unwrap() > 0.0 && beat["age_s"].as_f64().unwrap() >= 0.0, "{beat}");
    assert_eq!(item(&listing, "probe.0", "blob")["subscribers"], serde_json::json!([]), "nobody wants it");
    let silent = item(&listing, "probe.1", "beat");
    assert_eq!((&silent["rate_hz"], &silent["bytes"], &silent["age_s"]), (&Value::Null, &Value::Null, &Value::Null));
    let text = place.say(&["data", "probe.0", "--seconds", "0.5"]).ok();
    assert!(text.starts_with("module ") && text.contains("beat") && !text.contains("probe.1  beat"), "{text}");
    place.say(&["data", "probe.7"]).fails();
    let told = place.say(&["topic", "list"]);
    assert_eq!(
        (told.code, told.err.lines().next()),
        (Some(2), Some("error: `topic list` is a command of ROS 2; here it is: rohrpost data"))
    );
    place.end(&mut launch);
}

#[test]
fn streams_are_listed_under_the_name_that_writes_them() {
    let mapper = "[[module]]\nname = \"mapper.0\"\nbuiltin = \"mapper\"\ncalls = [\"laser.0\", \"odometry.0\"]\n\
                  settings = { laser = \"laser.0\", odometry = \"odometry.0\" }\n";
    let (place, mut launch, robot) = Place::running(&[&simulated(), OUTPUT, mapper]);
    robot.wait_on(&mut launch);
    let listing = wait("the mapper reads scans", || {
        let listing = place.say(&["data", "--seconds", "0.5", "--json"]).json();
        (item(&listing, "laser.0", "scan")["subscribers"] == serde_json::json!(["mapper.0"])).then_some(listing)
    });
    let scan = item(&listing, "laser.0", "scan");
    assert_eq!((&scan["as"], &scan["type"]), (&"stream".into(), &"rohrpost.LaserScan".into()));
    assert!(scan["members"].as_str().unwrap().contains("ranges_m"), "{scan}");
    assert!(scan["bytes"].as_f64().unwrap() > 100.0, "{scan}");
    place.end(&mut launch);
}
