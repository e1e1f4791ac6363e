//! What a scene remembers between two calls: of the world, the modules' states, the charts and the texts.

use crate::palette::Rgb;
use crate::trajectory::Trajectory;
use crate::world::extent::Extent;
use rerun::EntityPath;
use rohrpost::types::Pose;
use std::collections::{BTreeMap, HashMap, HashSet};

/// What the scene remembers of the world.
#[derive(Default)]
pub(crate) struct World {
    pub(crate) robots: HashMap<String, Robot>,
    pub(crate) tiles: HashMap<String, HashSet<(i64, i64)>>,
    pub(crate) extent: Extent,
    pub(crate) carrier: String,
}

/// A believed place, and the way to it.
#[derive(Default)]
pub(crate) struct Robot {
    pub(crate) pose: Pose,
    pub(crate) trajectory: Trajectory,
}

/// The last state of each module.
#[derive(Default)]
pub(crate) struct ModuleStates {
    pub(crate) last: BTreeMap<String, String>,
    /// System time of the table that was drawn last, ns.
    pub(crate) table_ns: u64,
    /// It does not say all.
    pub(crate) table_is_old: bool,
}

/// Classes in the order in which they came: it is their colour.
#[derive(Default)]
pub(crate) struct Charts {
    pub(crate) classes: HashMap<String, ChartClass>,
    drawn: HashSet<String>,
}

impl Charts {
    /// Whether it is asked for the first time in this scene: then what never changes is to be drawn.
    pub(crate) fn is_first(&mut self, what: &str) -> bool {
        !self.drawn.contains(what) && self.drawn.insert(what.into())
    }
}

/// A class of modules in the charts.
#[derive(Clone, Copy)]
pub(crate) struct ChartClass {
    pub(crate) index: usize,
    pub(crate) flows: bool,
    pub(crate) times: bool,
}

/// The last text of each datum, by its entity: a datum that says the same again says nothing.
#[derive(Default)]
pub(crate) struct Texts {
    pub(crate) last: HashMap<EntityPath, String>,
}

/// What a timeline of one robot has shown so far.
#[derive(Default)]
pub(crate) struct Lane {
    pub(crate) last: String,
    /// States that have a colour of their own.
    pub(crate) states: Vec<(String, Rgb)>,
}
