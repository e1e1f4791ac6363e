//! A scene drawn into memory, for the tests.

use crate::Scene;
use rerun::RecordingStreamBuilder;
use rerun::log::{Chunk, LogMsg};
use rerun::sink::MemorySinkStorage;
use std::collections::BTreeMap;

pub(crate) struct Drawing {
    pub(crate) scene: Scene,
    storage: MemorySinkStorage,
}

impl Drawing {
    pub(crate) fn new() -> Self {
        let (stream, storage) = RecordingStreamBuilder::new("rohrpost-test").memory().unwrap();
        Self { scene: Scene::over(stream, 0).unwrap(), storage }
    }

    pub(crate) fn at_s(&mut self, second: u64) {
        self.scene.set_time(second * 1_000_000_000);
    }

    /// What was drawn since the last call; the layout left out.
    pub(crate) fn chunks(&self) -> Vec<Chunk> {
        let recorded = self.storage.take().into_iter().filter_map(|message| match message {
            LogMsg::ArrowMsg(store, rows) if store.is_recording() => Some(Chunk::from_arrow_msg(&rows).unwrap()),
            _ => None,
        });
        recorded.collect()
    }

    /// How many rows each entity got since the last call.
    pub(crate) fn rows(&self) -> BTreeMap<String, usize> {
        let mut rows = BTreeMap::new();
        for chunk in self.chunks() {
            *rows.entry(chunk.entity_path().to_string()).or_default() += chunk.num_rows();
        }
        rows
    }
}
