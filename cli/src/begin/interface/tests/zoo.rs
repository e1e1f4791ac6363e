//! An interface with types of all kinds, names that are keywords in one language or the other, and odd texts.

use rohrpost::interface::Interface;
use rohrpost::schema::Description;
use rohrpost::types::{Bytes, Odometry};
use std::collections::BTreeMap;

#[allow(dead_code, unreachable_pub, reason = "nothing of it is called here")]
mod made {
    include!("../golden/zoo.rust");
}

/// Nothing in it.
#[rohrpost::data]
struct Marker;

/// A length.
#[rohrpost::data]
#[derive(Clone)]
pub(super) struct Meters(#[schema(unit = "m", min = -1.0, max = 1e9)] pub(super) f32);

#[rohrpost::data]
#[derive(Clone)]
pub(super) struct Pair(#[schema(unit = "°")] pub(super) i16, pub(super) char);

/// Whether it shines. "Quoted" */ text """ with \ signs.
#[rohrpost::data]
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Lamp {
    /// Dark.
    Off,
    #[serde(rename = "on-full")]
    On,
    None,
}

/// What to do.
#[rohrpost::data]
#[derive(Clone)]
pub(super) enum Order {
    Stop,
    /// How fast.
    Go(#[schema(unit = "m/s")] f64),
    Hold(Option<u8>),
    Turn(i32, bool),
    Drive {
        /// Forward.
        #[schema(unit = "m/s", min = 0.0, max = 1.5)]
        speed_m_s: f64,
        until: Option<Lamp>,
    },
}

#[rohrpost::data]
#[schema(name = "test.Pen")]
struct Pen<T> {
    inside: T,
}

/// Numbers of all sizes.
#[rohrpost::data]
pub(super) struct Numbers {
    pub(super) signed: (i8, i16, i32, i64, i128),
    pub(super) unsigned: (u8, u16, u32, u64),
    pub(super) huge: u128,
    pub(super) floats: (f32, f64),
}

#[rohrpost::data]
#[schema(name = "test.Zoo")]
pub(super) struct Animals {
    pub(super) numbers: Numbers,
    pub(super) small: [f64; 3],
    pub(super) no_room: [u8; 0],
    pub(super) flag: bool,
    pub(super) letter: char,
    pub(super) name: String,
    pub(super) nothing: (),
    pub(super) distance: Meters,
    pub(super) pair: Pair,
    pub(super) maybe: Option<u8>,
    pub(super) nested: [Option<Option<u8>>; 3],
    pub(super) some_nothing: [Option<()>; 2],
    pub(super) orders: Vec<Order>,
    pub(super) bytes: Vec<u8>,
    pub(super) blob: Bytes,
    pub(super) lists: Vec<Vec<i16>>,
    pub(super) by_name: BTreeMap<String, u16>,
    pub(super) by_number: BTreeMap<i64, char>,
    pub(super) by_lamp: BTreeMap<Lamp, bool>,
    pub(super) by_place: BTreeMap<(i8, i8), f32>,
    pub(super) result: Result<u8, String>,
    pub(super) units: Vec<()>,
    /// The same word in Python, Rust and C++.
    pub(super) r#class: u8,
    #[serde(rename = "from")]
    pub(super) origin: i8,
    pub(super) r#type: u8,
    #[serde(rename = "Odd name!")]
    pub(super) odd: u8,
    pub(super) odd_name: u8,
}

/// All kinds of types, and of names.
#[rohrpost::interface(class = "zoo")]
trait Zoo {
    /// Feeds one.
    #[command(16, idempotent)]
    fn feed(
        &mut self,
        #[schema(unit = "kg", min = 0.0, max = 20.5)] from: f64,
        #[schema(min = 1)] count: u8,
        order: Order,
    ) -> Result<Meters, Lamp>;

    #[command(17)]
    fn r#continue(&mut self);

    #[command(18)]
    fn publish(&mut self, lambda: Pen<Lamp>, other: Pen<u8>) -> Option<Odometry>;

    /// Two errors have one name.
    #[command(300)]
    fn clean(&mut self, marker: Marker) -> Result<(), String>;

    /// All animals.
    #[data(1)]
    fn animals() -> Animals;

    #[data(16384)]
    #[schema(unit = "rad", min = -3.2)]
    fn r#type() -> f32;

    /// Where it is.
    #[stream(3)]
    fn odometry() -> Odometry;
}

pub(super) fn description() -> Description {
    ZooInterface::description()
}

pub(super) fn generated_hash() -> u32 {
    made::ZooInterface::description().hash()
}

pub(super) fn animals() -> Animals {
    Animals {
        numbers: Numbers {
            signed: (i8::MIN, i16::MIN, i32::MIN, i64::MIN, i128::MIN),
            unsigned: (u8::MAX, u16::MAX, u32::MAX, u64::MAX),
            huge: u128::MAX,
            floats: (1.2, f64::NAN),
        },
        small: [f64::INFINITY, f64::NEG_INFINITY, -0.0],
        no_room: [],
        flag: true,
        letter: '🦀',
        name: "Rohr\u{1b}post ß".into(),
        nothing: (),
        distance: Meters(f32::NEG_INFINITY),
        pair: Pair(-300, 'ß'),
        maybe: Some(3),
        nested: [None, Some(None), Some(Some(9))],
        some_nothing: [None, Some(())],
        orders: vec![
            Order::Stop,
            Order::Go(2.5),
            Order::Hold(None),
            Order::Hold(Some(1)),
            Order::Turn(i32::MAX, true),
            Order::Drive { speed_m_s: 0.1, until: Some(Lamp::On) },
        ],
        bytes: vec![0, 128, 255],
        blob: vec![1, 2].into(),
        lists: vec![vec![], vec![-1, 300, i16::MAX], vec![-300]],
        by_name: [("a".into(), 1), (String::new(), 2)].into(),
        by_number: [(-5, 'x'), (i64::MAX, '\u{10ffff}')].into(),
        by_lamp: [(Lamp::Off, false), (Lamp::On, true), (Lamp::None, true)].into(),
        by_place: [((-1, 1), 0.3)].into(),
        result: Err("no".into()),
        units: vec![(); 3],
        r#class: 1,
        origin: -2,
        r#type: 3,
        odd: 4,
        odd_name: 5,
    }
}
