//! Types of every kind, with values at their edges.

use rohrpost_schema::{Bytes, Schema};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Serialize, Deserialize, Schema)]
pub(crate) struct Marker;

#[derive(Serialize, Deserialize, Schema)]
pub(crate) struct Meters(pub(crate) f32);

#[derive(Serialize, Deserialize, Schema)]
pub(crate) struct Pair(pub(crate) i16, pub(crate) char);

/// Whether it shines.
#[derive(Serialize, Deserialize, Schema, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Lamp {
    Off,
    #[serde(rename = "on")]
    On,
}

#[derive(Serialize, Deserialize, Schema)]
pub(crate) enum Order {
    Stop,
    Go(f64),
    Hold(Option<u8>),
    Turn(i32, bool),
    Drive {
        /// Forward.
        #[schema(unit = "m/s", min = 0.0, max = 1.5)]
        speed_m_s: f64,
        until: Option<Lamp>,
    },
}

#[derive(Serialize, Deserialize, Schema)]
#[schema(name = "test.Nested")]
pub(crate) struct Nested {
    pub(crate) lists: Vec<Vec<Vec<i16>>>,
    pub(crate) orders: Vec<Order>,
    pub(crate) maybe: Option<Vec<Option<Lamp>>>,
    pub(crate) fixed: [[f32; 2]; 2],
    pub(crate) by_name: BTreeMap<String, u16>,
    pub(crate) by_number: BTreeMap<i64, char>,
    pub(crate) by_lamp: BTreeMap<Lamp, bool>,
    pub(crate) by_place: BTreeMap<(i8, i8), f32>,
    pub(crate) blob: Bytes,
}

pub(crate) fn nested() -> Nested {
    Nested {
        lists: vec![vec![], vec![vec![], vec![-1, 300]], vec![vec![i16::MIN]]],
        orders: vec![
            Order::Stop,
            Order::Go(-0.0),
            Order::Hold(None),
            Order::Hold(Some(255)),
            Order::Turn(i32::MIN, true),
            Order::Drive { speed_m_s: 0.1, until: Some(Lamp::On) },
            Order::Drive { speed_m_s: f64::NEG_INFINITY, until: None },
        ],
        maybe: Some(vec![None, Some(Lamp::Off)]),
        fixed: [[0.1, f32::NAN], [f32::MAX, f32::MIN_POSITIVE]],
        by_name: [("a".into(), 1), (String::new(), 65_535)].into(),
        by_number: [(i64::MIN, 'x'), (5, '🦀')].into(),
        by_lamp: [(Lamp::Off, false), (Lamp::On, true)].into(),
        by_place: [((-1, 1), 0.3), ((2, -128), 1e-7)].into(),
        blob: vec![0, 128, 255].into(),
    }
}
