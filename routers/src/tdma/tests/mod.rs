//! The table by properties, the scheduler by scenes.

mod arithmetic;
mod overheard;
mod scenes;
mod single;
mod tables;
mod world;
