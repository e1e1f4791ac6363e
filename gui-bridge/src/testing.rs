//! A scene drawn onto a list, for the tests.

use crate::Scene;
use crate::blueprint::Layout;
use crate::scene::RowSink;
use crate::store::Row;
use rerun::EntityPath;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

#[derive(Default)]
struct List(Mutex<Vec<(EntityPath, Row)>>);

impl RowSink for List {
    fn put(&self, entity: EntityPath, row: Row) {
        self.0.lock().unwrap().push((entity, row));
    }

    fn line(&self, entity: EntityPath, row: Row) {
        self.put(entity, row);
    }

    fn arrange(&self, _: Layout) {}
}

pub(crate) struct TestScene {
    pub(crate) scene: Scene,
    list: Arc<List>,
}

impl TestScene {
    pub(crate) fn new() -> Self {
        let list = Arc::new(List::default());
        Self { scene: Scene::over(list.clone(), 0), list }
    }

    pub(crate) fn at_s(&mut self, second: u64) {
        self.scene.set_time(second * 1_000_000_000);
    }

    /// How many rows each entity got since the last call.
    pub(crate) fn rows(&self) -> BTreeMap<String, usize> {
        let mut rows = BTreeMap::new();
        for (entity, _) in self.list.0.lock().unwrap().drain(..) {
            *rows.entry(entity.to_string()).or_default() += 1;
        }
        rows
    }

    /// The components that each entity got since the last call, and how many numbers: of a blob, its bytes.
    pub(crate) fn components(&self) -> BTreeMap<String, BTreeMap<String, usize>> {
        let mut all: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for (entity, row) in self.list.0.lock().unwrap().drain(..) {
            let components = all.entry(entity.to_string()).or_default();
            for batch in row.components {
                let array = batch.array.to_data();
                let numbers = array.child_data().first().map_or(array.len(), |numbers| numbers.len());
                components.insert(batch.descriptor.component.to_string(), numbers);
            }
        }
        all
    }
}
