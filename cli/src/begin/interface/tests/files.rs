//! Files that are none, and what they are told.

use super::super::file::read;
use super::zoo;
use serde_json::{Value, json};

/// The file of the zoo, changed.
fn changed(change: impl Fn(&mut Value)) -> String {
    let mut json = serde_json::from_str(&super::file::write(&zoo::description()).unwrap()).unwrap();
    change(&mut json);
    json.to_string()
}

#[test]
fn what_is_wrong_with_a_file_is_told_with_its_place() {
    let set = |path: &'static str, value: Value| {
        changed(move |json| *json.pointer_mut(path).unwrap_or_else(|| panic!("{path}")) = value.clone())
    };
    let add = |path: &'static str, key: &'static str, value: Value| {
        changed(move |json| json.pointer_mut(path).unwrap()[key] = value.clone())
    };
    let take = |path: &'static str, key: &'static str| {
        changed(move |json| drop(json.pointer_mut(path).unwrap().as_object_mut().unwrap().remove(key)))
    };
    let deep = |levels: usize| format!("{}\"u8\"{}", "{\"list\": ".repeat(levels), "}".repeat(levels));
    for (file, says) in [
        (String::new(), "no JSON of an interface: EOF"),
        ("[]".into(), "the whole: expected an object, got `[]`"),
        ("{}".into(), "format: not given; expected the number of the format"),
        (set("/format", json!(2)), "format: format 2, this program reads 1"),
        (set("/format", json!("1")), "format: expected the number of the format, got `\"1\"`"),
        (set("/hash", json!("0x00000000")), "the file says hash 0x00000000, and what it describes has 0x"),
        (set("/hash", json!("\u{1b}[2J\n")), "the file says hash \\u001b[2J\\n, and"),
        (set("/name", json!(7)), "name: expected a text, got `7`"),
        (set("/class", json!("other")), "the file says hash 0x"),
        (add("", "more\u{1b}\n", json!(1)), "more\\u001b\\n: nothing of this name belongs here"),
        (take("", "data"), "data: not given; expected a list of data"),
        (take("/functions/0", "idempotent"), "functions[0].idempotent: not given; expected true or false"),
        (set("/functions/0/number", json!(-1)), "functions[0].number: expected a number from 0 to 65535, got `-1`"),
        (set("/functions/0/number", json!(65_536)), "functions[0].number: expected a number from 0 to 65535"),
        (set("/functions/0/arguments", json!({})), "functions[0].arguments: expected a list, got `{}`"),
        (set("/functions/0/arguments/0/min", json!("x")), "functions[0].arguments[0].min: expected a number (f64)"),
        (set("/functions/0/result", json!("f65")), "functions[0].result: expected a type, such as `f64`"),
        (set("/functions/0/result", json!({"list": 1})), "functions[0].result.list: expected a type"),
        (set("/functions/0/result", json!({"array": [1]})), "functions[0].result.array: expected a list of two"),
        (set("/functions/0/result", json!({"array": [-1, "u8"]})), "result.array[0]: expected a number of elements"),
        (set("/functions/0/result", json!({"struct": {"name": "A"}})), "result.struct.members: not given"),
        (
            set("/functions/0/result", json!({"struct": {"name": "A", "members": {"both": []}}})),
            "result.struct.members: expected `none`, or an object with `one`, `tuple` or `fields`, got",
        ),
        (set("/data/0/kind", json!("lake")), "data[0].kind: expected `data` or `stream`, got `\"lake\"`"),
        (add("/data/0", "type", serde_json::from_str(&deep(100)).unwrap()), "the file says hash"),
        (add("/data/0", "type", json!("DEEP")).replace("\"DEEP\"", &deep(200)), "no JSON of an interface: recursion"),
        (
            add("/data/0", "type", json!("DEEP")).replace("\"DEEP\"", &deep(100_000)),
            "no JSON of an interface: recursion",
        ),
    ] {
        let told = read(&file).map_or_else(|error| error.to_string(), |_| "it was read".into());
        assert!(told.contains(says), "{told}\nexpected: {says}");
    }
}

#[test]
fn a_file_has_no_more_types_than_a_description_may_have() {
    let tuple: Vec<&str> = vec!["u8"; 20_000];
    let file = changed(|json| json["data"][0]["type"] = json!({ "tuple": tuple }));
    assert_eq!(read(&file).unwrap_err().to_string(), "no interface: more than 16384 types");
}

/// A file of two megabytes would take a hundred times as much memory.
#[test]
fn a_file_of_too_many_values_is_refused_before_they_are_made() {
    let text = format!("{{\"data\": [{}0]}}", "{\"\":0},".repeat(200_000));
    let says = "more than 262144 values of JSON; an interface has at most 16384 types, and needs fewer";
    assert_eq!(read(&text).unwrap_err().to_string(), says);
    let said = changed(|json| json["text"] = json!(",[{\\\"".repeat(100_000)));
    assert!(read(&said).is_ok(), "what is in a text does not count");
}
