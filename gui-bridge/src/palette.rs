//! Colours that are distinct on a dark background, for colour-blind viewers as well.

/// Red, green, blue.
pub(crate) type Rgb = [u8; 3];

/// The robot where it is believed to be.
pub(crate) const ROBOT: Rgb = [255, 150, 40];
/// Where odometry alone puts it.
pub(crate) const ODOMETRY: Rgb = [122, 138, 158];
/// What the scanner sees.
pub(crate) const SCAN: Rgb = [255, 64, 96];
/// The least of what a cloud's points tell, and the most.
const SHADES: [Rgb; 2] = [[70, 60, 160], [255, 214, 120]];
/// Ground of the world's view; unknown parts of the map show it.
pub(crate) const GROUND: Rgb = [38, 42, 50];
/// Lines that help to read, such as the map's scale.
pub(crate) const AID: Rgb = [104, 112, 126];
/// A square that is free, and one that is occupied.
pub(crate) const FREE: Rgb = [226, 228, 224];
/// See [`FREE`].
pub(crate) const OCCUPIED: Rgb = [16, 22, 34];
/// A wall in space, and a path between walls.
pub(crate) const WALL: Rgb = [92, 100, 114];
/// See [`WALL`].
pub(crate) const PATH: Rgb = [58, 64, 75];
/// Modes of a robot of a team, and that it knows no place.
pub(crate) const WANDERING: Rgb = [235, 236, 232];
/// See [`WANDERING`].
pub(crate) const SEARCHING: Rgb = [255, 220, 60];
/// See [`WANDERING`].
pub(crate) const BLOCKING: Rgb = [255, 45, 45];
/// See [`WANDERING`].
pub(crate) const LOST: Rgb = [200, 80, 255];
/// What is around a robot that its program does not drive, and its heading.
pub(crate) const NOT_ITS_PROGRAM: Rgb = [250, 250, 250];
/// See [`NOT_ITS_PROGRAM`].
pub(crate) const HEADING: Rgb = [250, 250, 250];
/// What is above the leader of a group.
pub(crate) const LEADER: Rgb = [255, 205, 0];
/// An intruder's body, and one that a station made up.
pub(crate) const INTRUDER: Rgb = [150, 20, 40];
/// See [`INTRUDER`].
pub(crate) const FAKE: Rgb = [255, 130, 230];
/// A touch.
pub(crate) const TOUCH: Rgb = [255, 0, 0];

/// Okabe and Ito's eight without black: one for each class, in the order in which classes come.
const SERIES: [Rgb; 8] = [
    [86, 180, 233],
    [230, 159, 0],
    [0, 178, 130],
    [224, 130, 180],
    [240, 228, 66],
    [213, 94, 0],
    [120, 140, 255],
    [190, 190, 190],
];

/// The colour of the `index`th series; they come again after eight.
pub(crate) fn series(index: usize) -> Rgb {
    SERIES[index % SERIES.len()]
}

/// The same hue, nearer to the ground: for what stands beside the main thing.
pub(crate) fn muted(colour: Rgb) -> Rgb {
    colour.map(|part| (u16::from(part) * 11 / 20) as u8)
}

/// Colour of a point of a cloud, by its share from the least to the most, 0 to 1.
pub(crate) fn shaded(share: f32) -> Rgb {
    let share = share.clamp(0.0, 1.0);
    let [least, most] = SHADES.map(|shade| shade.map(f32::from));
    std::array::from_fn(|part| (least[part] + (most[part] - least[part]) * share) as u8)
}

/// Colour of a map's square, 0..=100 percent occupied.
pub(crate) fn occupancy(percent: u8) -> Rgb {
    let share = i32::from(percent.min(100));
    std::array::from_fn(|part| {
        let (free, occupied) = (i32::from(FREE[part]), i32::from(OCCUPIED[part]));
        (free + (occupied - free) * share / 100) as u8
    })
}
