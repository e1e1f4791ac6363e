//! What stands in the files of cases. Each case is a question in the words of the line protocol (README), and what the
//! answer is to be.

use crate::types::{Lamp, Marker, Meters, Order, Pair, nested};
use rohrpost_mailbox::{Head, Name, Options, Priority, Type as Kind};
use rohrpost_modules::call::Fault;
use rohrpost_modules::interface::Interface as _;
use rohrpost_modules::interfaces::{CameraInterface, CartographerInterface, LaserInterface, MotorInterface};
use rohrpost_modules::interfaces::{CollectorInterface, WheelsInterface};
use rohrpost_schema::{Bytes, Description, Schema, Type, Value, decode, encode};
use serde::Serialize;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;

const PAGE: &str = include_str!("../../docs/src/wire.md");

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn unhex(text: &str) -> Option<Vec<u8>> {
    let pairs = text.as_bytes().chunks(2);
    pairs.map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()).collect()
}

pub(crate) fn files() -> [(&'static str, Vec<Json>); 6] {
    [
        ("names", names()),
        ("heads", heads()),
        ("values", values()),
        ("refused", refused()),
        ("descriptions", descriptions()),
        ("wire", wire()),
    ]
}

fn case(ask: Json, answer: Json) -> Json {
    json!({"ask": ask, "answer": answer})
}

fn names() -> Vec<Json> {
    let texts =
        ["1.200.0.2", "0.0.0.0", "255.255.255.255", "254.1.0.3", "1.2.3", "1.2.3.256", "1..3.4", "1.-2.3.4", ""];
    let of = |text: &str| match text.parse::<Name>() {
        Ok(name) => case(json!({"do": "name", "text": text}), json!({"ok": name.raw()})),
        Err(error) => case(json!({"do": "name", "text": text}), json!({"error": error.to_string()})),
    };
    texts.into_iter().map(of).collect()
}

fn heads() -> Vec<Json> {
    let head = Head { to: Name::new(1, 200, 0, 0), from: Name::new(3, 96, 7, 1), ..Head::default() };
    let heads = [
        Head { kind: Kind::command(16), id: 7, priority: Priority(140), len: 36, ..head },
        Head { kind: Kind::reply(16), id: 0xfffe, priority: Priority(0), options: Options::ERROR, ..head },
        Head { kind: Kind::data(0), priority: Priority(255), options: Options::STAMPED.with(Options::NEWEST), ..head },
        Head { kind: Kind::data(16_384), len: 65_519, ..head },
        Head { kind: Kind::command(16_383), options: Options::REDELIVERED, ..head },
    ];
    heads.into_iter().flat_map(|head| ["little", "big"].map(|order| head_case(&head, order))).collect()
}

/// The bytes by the page's table, so that they do not depend on the byte order of this computer.
fn head_case(head: &Head, order: &str) -> Json {
    let big = order == "big";
    let four = |number: u32| if big { number.to_be_bytes() } else { number.to_le_bytes() };
    let two = |number: u16| if big { number.to_be_bytes() } else { number.to_le_bytes() };
    let mut bytes = [four(head.to.raw()), four(head.from.raw())].concat();
    bytes.extend([two(head.len), two(head.kind.0 as u16), two(head.id)].concat());
    let options = head.options.0 | u8::from(big);
    bytes.extend([head.priority.0, options]);
    assert_eq!(Head::from_bytes(&bytes).map(|read| (read.to, read.kind)), Ok((head.to, head.kind)));
    let fields = json!({
        "to": head.to.raw(), "from": head.from.raw(), "len": head.len, "type": head.kind.0, "id": head.id,
        "priority": head.priority.0, "options": options,
    });
    case(json!({"do": "head", "bytes": hex(&bytes)}), json!({"ok": fields}))
}

/// A value of a Rust type: its bytes are postcard's own.
fn value<T: Serialize + Schema>(what: &str, value: &T) -> [Json; 2] {
    let (ty, bytes) = (T::schema(), postcard::to_stdvec(value).unwrap());
    let json = serde_json::to_value(decode(&ty, &bytes).unwrap()).unwrap();
    let described = hex(&ty.to_bytes());
    [
        case(json!({"do": "decode", "what": what, "type": described, "bytes": hex(&bytes)}), json!({"ok": json})),
        case(json!({"do": "encode", "what": what, "type": described, "value": json}), json!({"ok": hex(&bytes)})),
    ]
}

fn values() -> Vec<Json> {
    let bools: BTreeMap<bool, u8> = [(false, 1), (true, 2)].into();
    [
        value("bool", &true),
        value("unit", &()),
        value("a struct of nothing", &Marker),
        value("u8", &u8::MAX),
        value("u16", &u16::MAX),
        value("u32", &300u32),
        value("u64 beyond what JSON's readers take for exact", &u64::MAX),
        value("u128", &u128::MAX),
        value("i8", &i8::MIN),
        value("i16", &i16::MIN),
        value("i32", &-1i32),
        value("i64", &i64::MIN),
        value("i128", &i128::MIN),
        value("i128", &i128::MAX),
        value("f32 by its shortest decimal", &1.2f32),
        value("f32", &f32::MIN_POSITIVE),
        value("f32 that is not a number", &f32::NAN),
        value("f64", &0.1f64),
        value("f64 that is not a number", &f64::NAN),
        value("f64 without end", &f64::NEG_INFINITY),
        value("char", &'🦀'),
        value("text", &"Rohr\u{1b}post ß".to_owned()),
        value("list of u8", &vec![0u8, 128, 255]),
        value("bytes", &Bytes(vec![1, 2])),
        value("none", &None::<u8>),
        value("some", &Some(3u8)),
        value("option of an option", &[None, Some(None), Some(Some(9u8))]),
        value("option of nothing", &[None, Some(())]),
        value("array", &[1u16, 2, 3]),
        value("tuple", &(1u8, 'x', -2i16)),
        value("list of units", &vec![(); 3]),
        value("struct that wraps", &Meters(f32::INFINITY)),
        value("struct without names", &Pair(-300, 'ß')),
        value("enum", &Lamp::On),
        value("enum that carries", &Order::Turn(-1, true)),
        value("result", &Err::<u8, String>("no".into())),
        value("map by bool", &bools),
        value("nested", &nested()),
    ]
    .concat()
}

fn refused() -> Vec<Json> {
    let bytes: [(Type, &[u8]); 13] = [
        (Vec::<f64>::schema(), &[0xff; 10]),
        (Vec::<f64>::schema(), &[0xff, 0xff, 0xff, 0x7f, 1]),
        (Vec::<f64>::schema(), &[1, 0]),
        (Vec::<Vec<u8>>::schema(), &[2, 1, 7, 3, 1]),
        (bool::schema(), &[2]),
        (u16::schema(), &[0xff, 0xff, 4]),
        (String::schema(), &[1, 0xff]),
        (char::schema(), &[2, b'a', b'b']),
        (Order::schema(), &[9]),
        (Order::schema(), &[4, 0]),
        (BTreeMap::<u8, bool>::schema(), &[1, 7, 3]),
        (<()>::schema(), &[0, 0]),
        (Vec::<()>::schema(), &[0x81, 0x80, 0x04]),
    ];
    let values = [
        (u8::schema(), json!(256)),
        (u8::schema(), json!(-1)),
        (u8::schema(), json!(0.5)),
        (u8::schema(), json!("0x")),
        (u8::schema(), json!(true)),
        (i8::schema(), json!(-129)),
        (f32::schema(), json!(1e39)),
        (f64::schema(), json!("wide")),
        (bool::schema(), json!(1)),
        (char::schema(), json!("ab")),
        (<(u8, u8)>::schema(), json!([1])),
        (Lamp::schema(), json!("o")),
        (Vec::<u8>::schema(), json!([1, 256])),
        (Option::<Option<u8>>::schema(), json!(5)),
        (Order::schema(), json!({"Drive": {}})),
        (Order::schema(), json!({"Drive": {"speed_m_s": 0, "sped": 1}})),
    ];
    // What only one thing can be meant by is understood.
    let meant = [
        (u32::schema(), json!(1e3)),
        (u32::schema(), json!("0x1f")),
        (u128::schema(), json!("340282366920938463463374607431768211455")),
        (f64::schema(), json!("-inf")),
        (f32::schema(), json!(3)),
        (Lamp::schema(), json!("ON")),
        (Order::schema(), json!({"drive": {"speed_m_s": 1}})),
        (BTreeMap::<u8, bool>::schema(), json!([[7, true]])),
    ];
    let of_bytes = bytes.into_iter().map(|(ty, bytes)| {
        let error = decode(&ty, bytes).unwrap_err().to_string();
        let ask = json!({"do": "decode", "type": hex(&ty.to_bytes()), "bytes": hex(bytes)});
        case(ask, json!({"error": error}))
    });
    let of_values = values.into_iter().chain(meant).map(|(ty, json)| {
        let value: Value = serde_json::from_value(json.clone()).unwrap();
        let answer = match encode(&ty, &value) {
            Ok(bytes) => json!({"ok": hex(&bytes)}),
            Err(error) => json!({"error": error.to_string()}),
        };
        case(json!({"do": "encode", "type": hex(&ty.to_bytes()), "value": json}), answer)
    });
    of_bytes.chain(of_values).collect()
}

fn descriptions() -> Vec<Json> {
    let interfaces = [
        MotorInterface::description(),
        WheelsInterface::description(),
        LaserInterface::description(),
        CameraInterface::description(),
        CartographerInterface::description(),
        CollectorInterface::description(),
        Description::from_bytes(&block("description")).unwrap(),
    ];
    let good = interfaces.into_iter().map(|its| {
        let bytes = its.to_bytes();
        let ok = json!({"name": its.name, "class": its.class, "hash": its.hash(), "again": hex(&bytes)});
        case(json!({"do": "interface", "bytes": hex(&bytes)}), json!({"ok": ok}))
    });
    let deep = [vec![2], vec![17; 200], vec![0]].concat();
    // Many are promised, and none is there.
    let many = [2, 21, 0xff, 0xff, 0xff, 0xff, 15];
    let bad: [&[u8]; 8] = [&[], &[1], &[2], &[2, 24], &[2, 0, 0], &[2, 15, 1], &deep, &many];
    let bad = bad.into_iter().map(|bytes| {
        let error = Type::from_bytes(bytes).unwrap_err().to_string();
        case(json!({"do": "type", "bytes": hex(bytes)}), json!({"error": error}))
    });
    let types = [nested_type(), Order::schema(), <Option<[f32; 3]>>::schema()];
    let types = types.into_iter().map(|ty| {
        let bytes = hex(&ty.to_bytes());
        case(json!({"do": "type", "bytes": bytes}), json!({"ok": {"hash": ty.hash(), "again": bytes}}))
    });
    good.chain(types).chain(bad).collect()
}

fn nested_type() -> Type {
    crate::types::Nested::schema()
}

/// The bytes of a block of the page.
fn block(name: &str) -> Vec<u8> {
    let fence = format!("\n```hex {name}\n");
    let text = PAGE.split(&fence).nth(1).unwrap_or_else(|| panic!("no ```hex {name}")).split("\n```").next().unwrap();
    let pairs = text.lines().flat_map(|line| line.split("  ").next().unwrap_or_default().as_bytes().chunks(2));
    let byte = |pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16);
    pairs.map(|pair| byte(pair).unwrap_or_else(|_| panic!("{name}: `{pair:?}`"))).collect()
}

/// The page's examples, and each fault.
fn wire() -> Vec<Json> {
    let packages = ["command", "reply", "set", "line"].map(|name| {
        let bytes = block(name);
        let answer = crate::client::package(&bytes).unwrap();
        case(json!({"do": "package", "what": name, "bytes": hex(&bytes)}), json!({"ok": answer}))
    });
    let text = || "line\nbreak".to_owned();
    let faults = [
        Fault::ModuleOff,
        Fault::ModuleError(text()),
        Fault::Interrupted,
        Fault::InterfaceDiffers { server: 0xb682_1d1a },
        Fault::Unknown(16),
        Fault::Arguments(text()),
        Fault::Expired,
        Fault::Busy,
        Fault::NothingYet,
        Fault::TooLarge(70_000),
        Fault::NoMailbox,
        Fault::MailboxFull,
        Fault::CommandTooLarge(1024),
        Fault::NoRoute,
        Fault::NodeSilent { node: "arm".into() },
        Fault::NodeDeaf { node: "arm".into() },
        Fault::NodeRefuses { node: "arm".into(), why: text() },
        Fault::RouterFull,
        Fault::Delayed,
        Fault::NotAllowed { node: "arm".into(), rule: "robot.toml:7".into() },
        Fault::EarlierIncarnation,
    ];
    let faults = faults.into_iter().enumerate().map(|(number, fault)| {
        let bytes = postcard::to_stdvec(&fault).unwrap();
        let ok = json!({"number": number, "one_try": fault.is_of_this_try(), "words": fault.to_string()});
        case(json!({"do": "fault", "bytes": hex(&bytes)}), json!({"ok": ok}))
    });
    packages.into_iter().chain(faults).collect()
}
