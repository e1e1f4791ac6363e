//! The bytes of each kind of type, both ways; what is refused; what counts in a hash. The bytes are those of
//! `docs/src/wire.md`.

use crate::bytes::PLAIN;
use crate::{
    DEPTH_MAX, DataItem, DataKind, Description, Field, Function, Members, Named, Schema, SchemaError, TYPES_MAX, Type,
    VERSION,
};
use std::collections::BTreeMap;

const PAGE: &str = include_str!("../../../../docs/src/wire.md");

/// A way to go.
#[derive(Schema)]
#[allow(dead_code, reason = "it is described, never made")]
#[schema(name = "rohrpost.Way")]
struct Way {
    /// How fast.
    #[schema(unit = "m/s", min = -1.0, max = 1.5)]
    speed: f32,
    steps: Vec<Step>,
}

#[derive(Schema)]
#[allow(dead_code, reason = "it is described, never made")]
enum Step {
    /// Nothing moves.
    Stop,
    Turn(#[schema(unit = "°", max = 180)] u8),
    Go(i16, bool),
    Arc {
        radius: f64,
    },
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

#[test]
fn each_kind_of_type_has_its_bytes() {
    let field = |name: &str, ty| Field::new(name, ty);
    let structure = |members| Type::Struct(Named::new("S", members));
    for (ty, bytes) in [
        (<()>::schema(), "02 00"),
        (bool::schema(), "02 01"),
        (u8::schema(), "02 02"),
        (u16::schema(), "02 03"),
        (u32::schema(), "02 04"),
        (u64::schema(), "02 05"),
        (usize::schema(), "02 05"),
        (u128::schema(), "02 06"),
        (i8::schema(), "02 07"),
        (i16::schema(), "02 08"),
        (i32::schema(), "02 09"),
        (i64::schema(), "02 0a"),
        (isize::schema(), "02 0a"),
        (i128::schema(), "02 0b"),
        (f32::schema(), "02 0c"),
        (f64::schema(), "02 0d"),
        (char::schema(), "02 0e"),
        (String::schema(), "02 0f"),
        (Type::Bytes, "02 10"),
        (Option::<f64>::schema(), "02 11 0d"),
        (Vec::<u8>::schema(), "02 12 02"),
        (<[f32; 300]>::schema(), "02 13 ac 02 0c"),
        (BTreeMap::<String, bool>::schema(), "02 14 0f 01"),
        (<(u8, char)>::schema(), "02 15 02 02 0e"),
        (structure(Members::None), "02 16 01 53 00 00"),
        (structure(Members::One(Box::new(field("", Type::U8)))), "02 16 01 53 00 01 00 00 02"),
        (structure(Members::Tuple(vec![field("", Type::U8); 2])), "02 16 01 53 00 02 02 00 00 02 00 00 02"),
        (structure(Members::Fields(vec![field("x", Type::U8)])), "02 16 01 53 00 03 01 01 78 00 02"),
        (
            <Result<(), String>>::schema(),
            "02 17 06 52 65 73 75 6c 74 00 02 02 4f 6b 00 01 00 00 00 03 45 72 72 00 01 00 00 0f",
        ),
        (
            Way::schema(),
            "02 16 0c 72 6f 68 72 70 6f 73 74 2e 57 61 79 0c 41 20 77 61 79 20 74 6f 20 67 6f 2e 03 02 \
             05 73 70 65 65 64 0f 09 48 6f 77 20 66 61 73 74 2e 03 6d 2f 73 04 00 00 80 bf 04 00 00 c0 3f 0c \
             05 73 74 65 70 73 00 12 17 04 53 74 65 70 00 04 \
             04 53 74 6f 70 0e 4e 6f 74 68 69 6e 67 20 6d 6f 76 65 73 2e 00 \
             04 54 75 72 6e 00 01 00 0a 02 c2 b0 01 b4 02 \
             02 47 6f 00 02 02 00 00 08 00 00 01 \
             03 41 72 63 00 03 01 06 72 61 64 69 75 73 00 0d",
        ),
    ] {
        assert_eq!(hex(&ty.to_bytes()), bytes, "{ty:?}");
        assert_eq!(Type::from_bytes(&ty.to_bytes()), Ok(ty));
    }
}

#[test]
fn what_is_no_type_is_refused_by_name() {
    let read = |hex: &str| {
        let bytes: Vec<u8> = hex.split(' ').map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect();
        Type::from_bytes(&bytes).unwrap_err()
    };
    for (bytes, expected) in [
        ("01 00", "descriptions of version 1, this program knows 2; use programs of the same version of Rohrpost"),
        // As postcard-schema wrote a u32 once.
        (
            "03 75 33 32 08",
            "descriptions of version 3, this program knows 2; use programs of the same version of Rohrpost",
        ),
        ("02", "the description ends too early"),
        ("02 0f 00 00", "2 bytes behind the end of the description"),
        ("02 18", "the byte 24 is no type"),
        ("02 16 01 53 00 04", "the byte 4 is no kind of members"),
        ("02 16 01 53 00 01 00 10 02", "the byte 16 is no sum of marks"),
        ("02 16 01 ff", "text that is not UTF-8"),
        ("02 13 ff ff ff ff 10", "a number that does not fit 32 bits"),
        ("02 15 ff ff ff ff 0f", "the description ends too early"),
    ] {
        assert_eq!(read(bytes).to_string(), expected, "{bytes}");
    }
}

#[test]
fn depth_and_number_are_bounded() {
    let options = |levels: usize| [&[VERSION][..], &[17].repeat(levels - 1), &[0]].concat();
    assert!(Type::from_bytes(&options(DEPTH_MAX)).is_ok());
    assert_eq!(Type::from_bytes(&options(DEPTH_MAX + 1)), Err(SchemaError::Deep));
    assert_eq!(Type::from_bytes(&options(1_000_000)), Err(SchemaError::Deep));
    let units = |count: usize| Type::from_bytes(&Type::Tuple(vec![Type::Unit; count]).to_bytes());
    assert!(units(TYPES_MAX - 1).is_ok());
    assert_eq!(units(TYPES_MAX), Err(SchemaError::Many));
}

#[test]
fn texts_and_ranges_do_not_count_names_and_units_do() {
    let way = |change: &dyn Fn(&mut Named, &mut Field)| {
        let mut speed = Field::new("speed", Type::F32).said("How fast.", "m/s");
        let mut named = Named::new("rohrpost.Way", Members::None).said("A way to go.");
        change(&mut named, &mut speed);
        named.members = Members::Fields(vec![speed, Field::new("steps", Vec::<Step>::schema())]);
        Type::Struct(named)
    };
    let same = |change: &dyn Fn(&mut Named, &mut Field)| {
        let other = way(change);
        assert_eq!(other.hash() == Way::schema().hash(), other.is::<Way>());
        other.is::<Way>()
    };
    assert!(same(&|_, _| {}), "its range is left out");
    assert!(same(&|named, speed| (named.text, speed.text) = ("Else".into(), String::new())));
    assert!(same(&|_, speed| speed.most = Some(vec![0; 4])));
    assert!(!same(&|_, speed| speed.unit = "mm/s".into()));
    assert!(!same(&|_, speed| speed.name = "pace".into()));
    assert!(!same(&|named, _| named.name = "Way".into()));
    assert!(!same(&|_, speed| speed.ty = Type::F64));
}

/// The bytes of a block of the page: each line begins with digits, two a byte, then two spaces and words.
fn block(name: &str) -> Vec<u8> {
    let text = PAGE.split(&format!("\n```hex {name}\n")).nth(1).unwrap().split("\n```").next().unwrap();
    let pairs = text.lines().flat_map(|line| line.split("  ").next().unwrap_or_default().as_bytes().chunks(2));
    pairs.map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

#[test]
fn a_description_has_the_documented_bytes_and_hash() {
    let bound = |value: f64| crate::bound(&value);
    let angle = vec![Field::new("rad", Type::F32), Field::new("turns", Type::option(Type::I16))];
    let angle = Type::Struct(Named::new("Angle", Members::Fields(angle)));
    let turn = Function {
        number: 16,
        name: "turn".into(),
        text: "Turns.".into(),
        idempotent: true,
        arguments: vec![Field::new("by", Type::F64).said("", "rad").bounded(bound(0.0), bound(1.0))],
        result: <Result<(), String>>::schema(),
    };
    let description = Description {
        name: "Wheel".into(),
        class: "motor".into(),
        text: "A wheel.".into(),
        functions: vec![turn],
        data: vec![
            DataItem { number: 300, kind: DataKind::Data, field: Field::new("angle", angle).said("Where.", "") },
            DataItem { number: 2, kind: DataKind::Stream, field: Field::new("steps", Type::U32) },
        ],
    };
    assert_eq!(hex(&description.to_bytes()), hex(&block("description")));
    assert_eq!(Description::from_bytes(&block("description")).as_ref(), Ok(&description));
    let hash = description.hash();
    assert!(PAGE.contains(&format!("Its hash is `{hash:#010x}`")), "{hash:#010x}");
    // As the page says it: no text but names and units, and no range.
    let mut bare = description.clone();
    (bare.text, bare.functions[0].text, bare.data[0].field.text) = Default::default();
    bare.functions[0].arguments[0] = Field::new("by", Type::F64).said("", "rad");
    assert_eq!((bare.hash(), crate::hash(&bare.to_bytes())), (hash, hash));
}

#[test]
fn the_page_has_every_tag() {
    let (table, _) = PAGE.split("| tag | type |").nth(1).unwrap().split_once("\n\n").unwrap();
    let names = table.lines().skip(2).flat_map(|row| row.split('|').nth(2).unwrap().split(',').map(str::trim));
    let boxed = || Box::new(Type::Unit);
    let around = [
        Type::Option(boxed()),
        Type::List(boxed()),
        Type::Array(1, boxed()),
        Type::Map(boxed(), boxed()),
        Type::Tuple(Vec::new()),
        Type::Struct(Named::new("", Members::None)),
        Type::Enum { name: String::new(), text: String::new(), variants: Vec::new() },
    ];
    let types: Vec<Type> = PLAIN.into_iter().chain(around).collect();
    let named = types.iter().map(|ty| match serde_json::to_value(ty).unwrap() {
        serde_json::Value::Object(one) => one.into_iter().next().unwrap().0,
        name => name.as_str().unwrap().to_owned(),
    });
    assert!(names.eq(named), "the page names them in the order of their tags");
    for (tag, ty) in types.iter().enumerate() {
        assert_eq!(usize::from(ty.to_bytes()[1]), tag, "{ty:?}");
    }
}

#[test]
fn json_says_the_same() {
    let field = serde_json::json!({
        "name": "speed", "text": "How fast.", "unit": "m/s", "type": "f32", "min": -1.0, "max": 1.5,
    });
    let json = serde_json::to_value(Way::schema()).unwrap();
    assert_eq!(json["struct"]["name"], "rohrpost.Way");
    assert_eq!(json["struct"]["members"]["fields"][0], field);
    assert_eq!(
        serde_json::to_value(<Option<[u8; 2]>>::schema()).unwrap(),
        serde_json::json!({"option": {"array": [2, "u8"]}})
    );
}

#[test]
fn a_field_inside_of_postcard_is_its_bytes() {
    let Type::Struct(Named { members: Members::Fields(fields), .. }) = Way::schema() else { panic!("a struct") };
    let bytes = postcard::to_stdvec(&fields).unwrap();
    assert_eq!(bytes[0], 2);
    assert_eq!(usize::from(bytes[1]), fields[0].to_bytes().len());
    assert_eq!(postcard::from_bytes::<Vec<Field>>(&bytes), Ok(fields));
}
