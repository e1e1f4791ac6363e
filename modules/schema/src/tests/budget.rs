//! What a message may cost, whatever its description says: the cases that Python's client is held to, too.

use super::error_text;
use crate::{Field, Label, Members, Named, Type, Value, decode, numbers};

const CASES: &str = include_str!("../../../../tests/conformance/budget.json");

fn unhex(text: &str) -> Vec<u8> {
    let digits = text.as_bytes().as_chunks::<2>().0;
    digits.iter().map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

#[test]
fn both_languages_refuse_the_same_messages() {
    let cases: serde_json::Value = serde_json::from_str(CASES).unwrap();
    for case in cases.as_array().unwrap() {
        let text = |key: &str| case[key].as_str().unwrap();
        let ty = Type::from_bytes(&unhex(text("type"))).unwrap();
        let mut bytes = unhex(text("head"));
        bytes.extend(unhex(text("each")).repeat(case["times"].as_u64().unwrap() as usize));
        let told = decode(&ty, &bytes).err().map(|error| error.to_string());
        assert_eq!(told.as_deref(), case["error"].as_str(), "{}", text("what"));
    }
}

/// A list of structs of one byte.
fn of_structs(name: &str) -> Type {
    let fields = vec![Field::new(name, Type::U8)];
    Type::list(Type::Struct(Named::new("S", Members::Fields(fields))))
}

#[test]
fn all_values_of_a_list_share_the_names_of_their_fields() {
    let Value::List(values) = decode(&of_structs("level"), &[3, 7, 8, 9]).unwrap() else { panic!("a list") };
    let name = |value: &Value| match value {
        Value::Map(fields) => fields[0].0.clone(),
        other => panic!("{other}"),
    };
    let names: Vec<Label> = values.iter().map(name).collect();
    assert!(names.iter().all(|name| name.as_ptr() == names[0].as_ptr() && *name == "level"));
}

/// An answer of 60 kB to a description of 100 kB.
#[test]
fn a_long_name_is_not_printed_a_thousand_times() {
    let answer = [&[0xe0, 0xd4, 0x03][..], &[7; 60_000]].concat();
    let told = error_text(decode(&of_structs(&"n".repeat(100_000)), &answer));
    assert!(told.contains(": more than 545560 values in one"), "{}", &told[told.len() - 200..]);
    assert_eq!(numbers(&decode(&of_structs("n"), &answer).unwrap(), 9)[8].0, "[8].n");
}

/// A list has so many variants to look through once, not once for each of the maps in it.
#[test]
fn what_is_asked_of_a_type_is_asked_once() {
    let variants = (0..8_000).map(|n| Named::new(format!("n{n}"), Members::None)).collect();
    let key = Type::Enum { name: "Key".into(), text: String::new(), variants };
    let maps = Type::list(Type::Map(Box::new(key), Box::new(Type::U8)));
    let Value::List(all) = decode(&maps, &[&[0xe0, 0xd4, 0x03][..], &[0; 60_000]].concat()).unwrap() else {
        panic!("a list")
    };
    assert!(all.len() == 60_000 && all[0] == Value::Map(Vec::new()));
}

/// What is written as a bound may be as long as its author likes.
#[test]
fn only_words_have_bounds() {
    let many = Type::Array(60_000, Box::new(Type::Unit));
    let field = Field::new("many", many).bounded(Some(Vec::new()), Some(Vec::new()));
    assert_eq!(field.range(), None);
    assert_eq!(serde_json::to_string(&field).unwrap(), r#"{"name":"many","type":{"array":[60000,"unit"]}}"#);
}
