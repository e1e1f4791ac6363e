use super::*;
use crate::testing::TestScene;

fn map(fields: &[(&str, Value)]) -> Value {
    Value::Map(fields.iter().map(|(name, value)| ((*name).into(), value.clone())).collect())
}

/// Curves as `way=value`, then the lines of text.
fn check(value: &Value, curves: &[&str], text: &str) {
    let flat = flatten(value);
    let found: Vec<String> = flat.curves.iter().map(|(way, number)| format!("{}={number}", way.join("/"))).collect();
    assert_eq!(
        (found.as_slice(), flat.text.as_str()),
        (curves.iter().map(|c| (*c).into()).collect::<Vec<String>>().as_slice(), text)
    );
}

#[test]
fn numbers_become_curves_and_the_rest_becomes_text() {
    let battery = map(&[
        ("volts", Value::F(11.9)),
        ("cells", Value::List(vec![Value::U(4), Value::I(-1)])),
        ("charging", Value::Bool(true)),
        ("maker", Value::Text("Akku AG".into())),
        ("gauge", map(&[("full", Value::U(80)), ("note", Value::Null)])),
        ("raw", Value::Bytes(vec![0; 12])),
    ]);
    check(
        &battery,
        &["volts=11.9", "cells/0=4", "cells/1=-1", "charging=1", "gauge/full=80"],
        "maker: Akku AG\nraw: 12 bytes",
    );
}

#[test]
fn bare_values_have_no_way() {
    check(&Value::F(1.5), &["=1.5"], "");
    check(&Value::Text("hello".into()), &[], "hello");
    check(&Value::Null, &[], "");
}

#[test]
fn a_case_says_its_name_and_is_entered() {
    let moving = Value::Variant("Moving".into(), Box::new(map(&[("speed", Value::F(0.5))])));
    check(&map(&[("mode", moving)]), &["mode/Moving/speed=0.5"], "mode: Moving");
    check(&Value::Variant("Idle".into(), Box::new(Value::Null)), &[], "Idle");
}

#[test]
fn long_lists_are_described() {
    let ranges = Value::List((0..361).map(|beam| Value::F(f64::from(beam) / 10.0)).collect());
    check(&map(&[("ranges", ranges)]), &[], "ranges: 361 items, 0 to 36");
    let names = Value::List(vec![Value::Text("a".into()), Value::Text("b".into())]);
    check(&names, &[], "2 items, the first a");
}

#[test]
fn wide_deep_and_long_data_are_bounded() {
    let wide = Value::Map((0..500).map(|field| (format!("f{field}").into(), Value::U(field))).collect());
    let flat = flatten(&wide);
    assert_eq!(flat.curves.len(), CURVES_MAX);
    assert!(flat.text.len() <= TEXT_MAX && flat.text.contains("f64: 64"));
    let deep = (0..1000).fold(Value::U(1), |inner, _| map(&[("in", inner)]));
    assert!(flatten(&deep).curves.is_empty());
    assert!(flatten(&deep).text.ends_with("1 fields"));
}

#[test]
fn a_datum_lands_below_its_module_and_says_the_same_text_once() {
    let mut drawing = TestScene::new();
    for second in 0..5 {
        drawing.at_s(second);
        let gauge = map(&[("a/b", Value::U(second.into())), ("maker", Value::Text("Akku AG".into()))]);
        drawing.scene.generic("battery.0", "gauge", &gauge);
    }
    let rows = drawing.rows();
    assert_eq!(rows[r"/data/battery.0/gauge/a\/b"], 5, "a field's name is one part, whatever is in it");
    assert_eq!(rows["/data/battery.0/gauge"], 1);
}
