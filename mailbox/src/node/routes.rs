//! Which names are on other nodes, and the mailbox of the router that takes packages there: the file `routes`.
//!
//! ```text
//! routes  =  header (24 B)  +  ranges of names (8 B each: first, last), in order
//!            via: 1.250.0.3    1.200.0.0 ..= 1.200.0.255 | …
//! ```
//!
//! This crate does not know why: the router of the node works it out from the configuration. The file appears whole. It
//! is read only for a name that has no mailbox here, when a [`Sender`](crate::Sender) is opened.

use crate::memory::files::Directory;
use crate::memory::layout::{MAGIC, VERSION};
use crate::name::Name;
use crate::node::directory::Node;
use crate::node::error::NodeError;
use std::io;

/// Ranges that a node can have: all instances of every class of a system, alone.
pub const ROUTES_MAX: usize = 65_536;
/// All of them, in the order in which a name is looked for.
const FILES: [&str; 3] = [FILE, TEAM, BEYOND];
const HEAD_BYTES: usize = 24;
const RANGE_BYTES: usize = 8;

const FILE: &str = "routes";
/// Format of `routes`, for names of other systems that it does not contain.
const TEAM: &str = "routes.team";
/// Format of `routes`, for names that neither contains.
const BEYOND: &str = "routes.beyond";

impl Node {
    /// Says that packages for these names (first and last of each range) go to the mailbox `via`, if they have no
    /// mailbox here. What was said before is forgotten. Without ranges, nothing goes anywhere.
    ///
    /// # Errors
    /// When the file cannot be written; what was said before stays.
    ///
    /// # Panics
    /// When there are more than [`ROUTES_MAX`] ranges, or they are not in order and apart: the caller makes them from a
    /// configuration that was checked.
    pub fn set_routes(&self, via: Name, ranges: &[(Name, Name)]) -> Result<(), NodeError> {
        self.write_routes(FILE, via, ranges)
    }

    /// The same for names that have no mailbox here and for which [`set_routes`](Self::set_routes) names no range: what
    /// is beyond the nodes that the router knows.
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn set_routes_beyond(&self, via: Name, ranges: &[(Name, Name)]) -> Result<(), NodeError> {
        self.write_routes(BEYOND, via, ranges)
    }

    /// Says that packages for these names of other systems go to the mailbox `via`, if they have no mailbox here and
    /// [`set_routes`](Self::set_routes) names no range for them. These go before routes beyond.
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn set_routes_of_team(&self, via: Name, ranges: &[(Name, Name)]) -> Result<(), NodeError> {
        self.write_routes(TEAM, via, ranges)
    }

    fn write_routes(&self, file: &str, via: Name, ranges: &[(Name, Name)]) -> Result<(), NodeError> {
        assert!(ranges.len() <= ROUTES_MAX && ranges.iter().all(|(first, last)| first <= last));
        assert!(ranges.windows(2).all(|pair| pair[0].1 < pair[1].0), "ranges are in order, and none overlaps another");
        let mut bytes = Vec::with_capacity(HEAD_BYTES + ranges.len() * RANGE_BYTES);
        bytes.extend_from_slice(&MAGIC.to_ne_bytes());
        for field in [VERSION, via.raw(), ranges.len() as u32, 0] {
            bytes.extend_from_slice(&field.to_ne_bytes());
        }
        for (first, last) in ranges {
            bytes.extend_from_slice(&first.raw().to_ne_bytes());
            bytes.extend_from_slice(&last.raw().to_ne_bytes());
        }
        // Named after its writer: two that write at once must not write into one.
        let put = self.directory().put(file, &format!("{file}.{}", std::process::id()), &bytes);
        put.map_err(|error| NodeError::of(&self.path().join(file), error))?;
        // A sender that did not find a name before may find a way to it now.
        self.raise_registry_epoch();
        Ok(())
    }

    /// Nothing goes to other nodes any more, until that is said anew.
    ///
    /// # Errors
    /// When the file cannot be removed.
    pub fn forget_routes(&self) -> Result<(), NodeError> {
        for file in FILES {
            match self.directory().remove(file) {
                Ok(()) => self.raise_registry_epoch(),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(NodeError::of(&self.path().join(file), error)),
            }
        }
        Ok(())
    }

    /// The mailbox of the router that takes packages for this name to another node; none if it has no route. A name
    /// with a mailbox on this node may have one too: nobody follows it.
    pub fn route(&self, name: Name) -> Option<Name> {
        find(self.directory(), name).ok().flatten()
    }
}

/// The mailbox that packages for a name go to, or what is wrong with the file.
pub(crate) fn find(node: &Directory, name: Name) -> Result<Option<Name>, String> {
    for file in FILES {
        if let Some(via) = find_in(node, file, name)? {
            return Ok(Some(via));
        }
    }
    Ok(None)
}

fn find_in(node: &Directory, file_name: &str, name: Name) -> Result<Option<Name>, String> {
    let bytes = match node.read(file_name) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(format!("its file `{file_name}`: {error}")),
    };
    // Another process wrote it.
    let router = match file_name {
        BEYOND => "client of the TCP router",
        TEAM => "router of the team",
        _ => "router",
    };
    look_up(&bytes, name).ok_or_else(|| {
        format!("its file `{file_name}` is damaged, or another version's; start the node's {router} again")
    })
}

/// None when these bytes are no routes.
fn look_up(bytes: &[u8], name: Name) -> Option<Option<Name>> {
    let (head, ranges) = bytes.split_first_chunk::<HEAD_BYTES>()?;
    let field = |at: usize| u32::from_ne_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let (via, count) = (Name::from_raw(field(12)), field(16) as usize);
    let whole = head.starts_with(&MAGIC.to_ne_bytes()) && field(8) == VERSION && ranges.len() == count * RANGE_BYTES;
    if !whole || (count > 0 && !via.is_mailbox()) {
        return None;
    }
    let raw = |b: &[u8]| b.first_chunk().map_or(0, |b| u32::from_ne_bytes(*b));
    let has = |range: &[u8]| (raw(range)..=raw(&range[4..])).contains(&name.raw());
    Some(ranges.chunks_exact(RANGE_BYTES).any(has).then_some(via))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const VIA: Name = Name::new(1, 250, 0, 3);

    fn routes(ranges: &[(Name, Name)]) -> (tempfile::TempDir, std::sync::Arc<Node>) {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        node.set_routes(VIA, ranges).unwrap();
        (folder, node)
    }

    #[test]
    fn a_name_has_a_route_if_it_lies_in_a_range() {
        let first = (Name::new(1, 16, 64, 0), Name::new(1, 16, 127, 255));
        let second = (Name::new(1, 200, 0, 0), Name::new(1, 200, 0, 255));
        let (_folder, node) = routes(&[first, second]);
        for (name, goes, why) in [
            (Name::new(1, 16, 63, 255), false, "just before the first"),
            (Name::new(1, 16, 64, 0), true, "the first of the first"),
            (Name::new(1, 16, 127, 255), true, "the last of the first"),
            (Name::new(1, 16, 128, 0), false, "just behind it"),
            (Name::new(1, 200, 0, 7), true, "any mailbox of a module"),
            (Name::new(1, 200, 1, 0), false, "another instance"),
            (Name::new(2, 200, 0, 0), false, "another system"),
        ] {
            assert_eq!(node.route(name), goes.then_some(VIA), "{name}: {why}");
        }
    }

    #[test]
    fn new_routes_take_the_place_of_old_ones_and_raise_the_epoch() {
        let name = Name::new(1, 200, 0, 0);
        let (folder, node) = routes(&[(name, name)]);
        let epoch = node.registry_epoch();
        node.set_routes(VIA, &[]).unwrap();
        assert!(node.route(name).is_none() && node.registry_epoch() != epoch);
        let files: Vec<_> = fs::read_dir(folder.path().join("node")).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(files.len(), 2, "`node`, `routes`, and nothing unfinished: {files:?}");
        node.set_routes(VIA, &[(name, name)]).unwrap();
        node.forget_routes().unwrap();
        node.forget_routes().unwrap();
        assert!(node.route(name).is_none() && !node.path().join(FILE).exists());
    }

    #[test]
    fn what_has_no_route_is_looked_for_beyond() {
        const BEYOND_VIA: Name = Name::new(1, 64, 0, 3);
        const TEAM_VIA: Name = Name::new(1, 65, 0, 3);
        let (near, far) = (Name::new(1, 200, 0, 0), Name::new(2, 200, 0, 0));
        let (_folder, node) = routes(&[(near, near)]);
        let all = (Name::new(1, 1, 0, 0), Name::new(255, 255, 255, 255));
        node.set_routes_beyond(BEYOND_VIA, &[all]).unwrap();
        assert_eq!((node.route(near), node.route(far)), (Some(VIA), Some(BEYOND_VIA)));
        node.set_routes_of_team(TEAM_VIA, &[(far, all.1)]).unwrap();
        let absent = Name::new(1, 201, 0, 0);
        let found = [near, far, absent].map(|name| node.route(name));
        assert_eq!(found, [VIA, TEAM_VIA, BEYOND_VIA].map(Some));
        node.forget_routes().unwrap();
        assert_eq!((node.route(near), node.route(far)), (None, None));
    }

    #[test]
    fn bytes_that_are_no_routes_lead_nowhere() {
        let name = Name::new(1, 200, 0, 0);
        let (_folder, node) = routes(&[(name, name)]);
        let whole = fs::read(node.path().join(FILE)).unwrap();
        assert_eq!(look_up(&whole, name), Some(Some(VIA)));
        for cut in 0..whole.len() {
            assert_eq!(look_up(&whole[..cut], name), None, "cut to {cut}");
        }
        for (at, what) in [(0, "magic"), (8, "version"), (15, "the router's system"), (16, "count")] {
            let mut bytes = whole.clone();
            bytes[at] = if at == 15 { 0 } else { bytes[at] ^ 1 };
            assert_eq!(look_up(&bytes, name), None, "{what}");
        }
    }
}
