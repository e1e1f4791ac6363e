use super::*;
use crate::pinhole::tests::{FOUR, STAND, room};

fn picture(pinhole: Pinhole, stand: Pose) -> Vec<Rgb> {
    let mut camera = SimulatedCamera::new(pinhole);
    let mut pixels = vec![0; camera.image().raw_bytes() as usize];
    camera.render(&room(), &stand, &mut pixels);
    pixels.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}

fn wall(side: WallSide, depth_m: f32) -> Rgb {
    lit(WALL.map(|part| part * brightness(side)), depth_m)
}

/// Depths are those of `pinhole_tests`: walls at 2.67 m and 5 m; ceiling at 2 m and 6 m, floor at 4 m and 1.33 m.
#[test]
fn each_pixel_shows_what_is_nearer() {
    use WallSide::{North, South, West};
    let (near, far) = (2.0 / 0.75, 5.0);
    let ceiling = lit(CEILING, 2.0);
    // Tiles of 0.5 m. At a depth of 4 m: column 12, rows 8 and 4. At 1.33 m: column 6, rows 8, 6, 5 and 4.
    let floor = |tile: usize, depth_m| lit(FLOOR[tile], depth_m);
    let expected = [
        [ceiling; 4],
        [wall(South, near), wall(West, far), wall(West, far), wall(North, near)],
        [wall(South, near), floor(0, 4.0), floor(0, 4.0), wall(North, near)],
        [floor(0, 4.0 / 3.0), floor(0, 4.0 / 3.0), floor(1, 4.0 / 3.0), floor(0, 4.0 / 3.0)],
    ];
    // A little off the borders between tiles.
    let stand = Pose { x_m: STAND.x_m + 0.05, y_m: STAND.y_m + 0.05, ..STAND };
    let (exact, shifted) = (picture(FOUR, STAND), picture(FOUR, stand));
    assert_eq!(exact[..8], expected.concat()[..8], "ceiling and walls");
    for (index, (found, expected)) in shifted.iter().zip(expected.concat()).enumerate().skip(8) {
        let [found, expected] = [*found, expected].map(|colour| colour.map(i32::from));
        let off = std::iter::zip(found, expected).map(|(found, expected)| (found - expected).abs()).max();
        assert!(off <= Some(3), "pixel {index}: {found:?} and not {expected:?}");
    }
}

#[test]
fn what_is_deeper_is_darker_and_each_side_has_its_brightness() {
    use WallSide::{East, North, South, West};
    let red = |side, depth_m| wall(side, depth_m)[0];
    for depths in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 40.0].windows(2) {
        assert!(red(West, depths[0]) > red(West, depths[1]), "{depths:?} m");
    }
    let mut sides = [West, South, East, North].map(|side| red(side, 2.0));
    sides.sort_unstable();
    assert!(sides.windows(2).all(|pair| pair[1] - pair[0] >= 10), "corners show: {sides:?}");
    assert_eq!(lit(CEILING, f32::INFINITY), [0; 3]);
}

#[test]
fn a_camera_fills_the_image_that_it_names() {
    let camera = SimulatedCamera::new(CAMERA);
    let image = camera.image();
    assert_eq!((image.width_px, image.height_px, image.row_bytes), (640, 480, 1920));
    assert_eq!(image.raw_bytes(), 921_600);
}

#[test]
#[should_panic(expected = "three bytes for each pixel")]
fn pixels_of_another_size_are_a_mistake_of_the_caller() {
    SimulatedCamera::new(FOUR).render(&room(), &STAND, &mut [0; 47]);
}
