//! Reading what contains descriptions. Whoever reads them by serde alone goes as deep as the bytes say, and two bytes a level
//! are enough: a note of 64 KB from another process would end a tool by its stack.

use super::{DEPTH_MAX, WalkError, WalkProblem, decode::decode_within, meta};
use postcard_schema::schema::owned::OwnedNamedType;
use serde::de::DeserializeOwned;

/// What is read of a description takes so many steps a level at least, so that lists and options nest to [`DEPTH_MAX`];
/// structs and enums, which take more, to a third of it.
const STEPS_MAX: usize = 3 * DEPTH_MAX;

/// What has descriptions of types inside.
pub trait Described: DeserializeOwned {
    /// How its bytes are made up, as [`Data::schema`](super::Data::schema) says it of types that have no description inside.
    fn shape() -> OwnedNamedType;
}

impl Described for OwnedNamedType {
    fn shape() -> OwnedNamedType {
        meta::DESCRIPTION.clone()
    }
}

/// Reads bytes of another process, all of them, without believing how deep they nest.
///
/// # Errors
/// What is wrong with them, and where.
pub fn read_described<T: Described>(bytes: &[u8]) -> Result<T, WalkError> {
    decode_within(STEPS_MAX, &T::shape(), bytes)?;
    postcard::from_bytes(bytes).map_err(|error| WalkProblem::NotRead { error: error.to_string() }.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::ParameterPage;
    use crate::description::Description;
    use crate::interface::Interface;
    use crate::interfaces::{CartographerInterface, CollectorInterface, LaserInterface, MotorInterface};
    use crate::launcher::LauncherInterface;
    use crate::parameter::{Declared, Parameter};

    /// A type of this many levels: options of options, as two bytes each.
    fn nested(levels: usize) -> Vec<u8> {
        [[0, 18].repeat(levels), vec![0, 0]].concat()
    }

    #[test]
    fn what_modules_say_comes_back() {
        for description in [
            CartographerInterface::description(),
            CollectorInterface::description(),
            LaserInterface::description(),
            LauncherInterface::description(),
            MotorInterface::description(),
        ] {
            let bytes = postcard::to_stdvec(&description).unwrap();
            assert_eq!(read_described::<Description>(&bytes), Ok(description));
        }
        let declared = Declared { name: "near-m", text: "How near", unit: "m", least: Some(0.0), most: None };
        let parameters: Vec<Parameter> = [0.5, 1.5].iter().map(|value| declared.describe(value)).collect();
        let page = ParameterPage { total: 2, changes: 1, parameters };
        assert_eq!(read_described(&postcard::to_stdvec(&page).unwrap()), Ok(page));
    }

    #[test]
    fn what_nests_without_end_is_refused() {
        // As much as a program's first thread has, which reads descriptions; a test's has less, and unoptimised code needs much.
        let read = std::thread::Builder::new().stack_size(8 << 20).spawn(nest).unwrap();
        read.join().unwrap();
    }

    fn nest() {
        for (levels, fits) in [(0, true), (1, true), (DEPTH_MAX - 2, true), (DEPTH_MAX, false), (500_000, false)] {
            let read = read_described::<OwnedNamedType>(&nested(levels));
            let problem = read.err().map(|error| error.problem);
            assert_eq!(problem, (!fits).then_some(WalkProblem::TooDeep), "{levels} levels");
        }
    }
}
