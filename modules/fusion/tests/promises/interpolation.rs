//! Values in between agree with formulas that are not those of the crate: points of the unit circle, and rotations as
//! matrices by Rodrigues.

use nalgebra::{Isometry2, Isometry3, Point3, Quaternion, Translation3, UnitComplex, UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;
use rohrpost_fusion::{Heading, Interpolate, Share};
use std::f64::consts::{FRAC_PI_2, PI};

const ERROR_MAX: f64 = 1e-6;
const WHOLE: u64 = 1 << 20;

fn share(part: u64) -> Share {
    Share::between(77, 77 + part, 77 + WHOLE).unwrap()
}

type Matrix = [[f64; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| (0..3).map(|k| a[row][k] * b[k][column]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| a[column][row]))
}

/// The rotation about an axis, by Rodrigues.
fn about(axis: [f64; 3], angle_rad: f64) -> Matrix {
    let length = axis.iter().map(|part| part * part).sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|part| part / length);
    let (sine, cosine) = angle_rad.sin_cos();
    let rest = 1.0 - cosine;
    [
        [cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine],
        [y * x * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine],
        [z * x * rest - y * sine, z * y * rest + x * sine, cosine + z * z * rest],
    ]
}

fn matrix(rotation: &UnitQuaternion<f64>) -> Matrix {
    let matrix = rotation.to_rotation_matrix();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

fn quaternion(axis: [f64; 3], angle_rad: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::from(axis).normalize() * angle_rad)
}

/// The largest difference of two components.
fn apart(a: &Matrix, b: &Matrix) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn axis() -> impl Strategy<Value = [f64; 3]> {
    [-1.0..1.0f64, -1.0..1.0, -1.0..1.0]
        .prop_filter("an axis has a direction", |axis| axis.iter().map(|part| part * part).sum::<f64>() > 1e-3)
}

#[derive(Clone, Debug, PartialEq, Interpolate)]
#[interpolate(crate = rohrpost_fusion)]
struct Crane<T> {
    height_m: f64,
    #[interpolate(heading)]
    arm_rad: f64,
    #[interpolate(heading)]
    hook_rad: f32,
    rope_m: [f32; 2],
    load: T,
    #[interpolate(earlier)]
    holds: Option<String>,
    #[interpolate(nearer)]
    teeth: u16,
}

#[derive(Clone, Copy, Debug, PartialEq, Interpolate)]
#[interpolate(crate = rohrpost_fusion)]
struct Metres(f64, #[interpolate(earlier)] bool);

#[test]
fn each_field_goes_its_own_way() {
    let crane = |height_m, arm_rad, holds: &str, teeth| Crane {
        height_m,
        arm_rad,
        hook_rad: -arm_rad as f32,
        rope_m: [height_m as f32, 1.0],
        load: Metres(2.0 * height_m, teeth > 5),
        holds: Some(holds.to_owned()),
        teeth,
    };
    let (from, to) = (crane(1.0, 3.0, "a beam", 5), crane(3.0, -3.0, "a stone", 6));
    for (part, height_m, turned_rad, teeth) in [
        (0, 1.0, 0.0, 5),
        (WHOLE / 4, 1.5, 0.25, 5),
        (WHOLE / 2, 2.0, 0.5, 5),
        (WHOLE / 4 * 3, 2.5, 0.75, 6),
        (WHOLE, 3.0, 1.0, 6),
    ] {
        let found = Crane::interpolate(&from, &to, share(part));
        assert!((found.height_m - height_m).abs() < ERROR_MAX);
        let arm_rad = 3.0 + turned_rad * (2.0 * PI - 6.0);
        assert!((found.arm_rad.sin() - arm_rad.sin()).abs() < ERROR_MAX, "{found:?}");
        assert!((found.arm_rad.cos() - arm_rad.cos()).abs() < ERROR_MAX, "{found:?}");
        assert!((f64::from(found.hook_rad).sin() + arm_rad.sin()).abs() < ERROR_MAX, "{found:?}");
        assert_eq!(found.rope_m, [height_m as f32, 1.0]);
        assert_eq!(found.load, Metres(2.0 * height_m, false));
        assert_eq!((found.holds.as_deref(), found.teeth), (Some("a beam"), teeth));
    }
}

#[test]
fn no_share_lies_outside() {
    for (before_ns, at_ns, after_ns, share) in [
        (10, 10, 20, Some(0.0)),
        (10, 20, 20, Some(1.0)),
        (10, 15, 20, Some(0.5)),
        (10, 10, 10, Some(0.0)),
        (0, u64::MAX, u64::MAX, Some(1.0)),
        (0, u64::MAX - 1, u64::MAX, Some(1.0)),
        (10, 9, 20, None),
        (10, 21, 20, None),
        (20, 15, 10, None),
    ] {
        assert_eq!(Share::between(before_ns, at_ns, after_ns).map(Share::get), share, "{before_ns} {at_ns} {after_ns}");
    }
}

#[test]
fn opposite_headings_and_rotations_turn_one_way() {
    // Counter-clockwise, from and to either side of the seam.
    for (from_rad, to_rad, middle_rad) in [(0.0, PI, FRAC_PI_2), (0.0, -PI, FRAC_PI_2), (FRAC_PI_2, -FRAC_PI_2, PI)] {
        let middle = f64::turn(&from_rad, &to_rad, share(WHOLE / 2));
        assert!((middle - middle_rad).abs() < ERROR_MAX, "{from_rad} {to_rad}: {middle}");
        let turned = UnitComplex::interpolate(&UnitComplex::new(from_rad), &UnitComplex::new(to_rad), share(WHOLE / 2));
        assert!((turned.angle().cos() - middle_rad.cos()).abs() < ERROR_MAX);
        assert!((turned.angle().sin() - middle_rad.sin()).abs() < ERROR_MAX, "{from_rad} {to_rad}: {turned}");
    }
    // About the axis that points forward, whichever of the two quaternions stands for the half turn.
    for (parts, sign) in [([1.0, 0.0, 0.0], 1.0), ([0.0, 1.0, 0.0], 1.0), ([0.0, 0.0, -1.0], -1.0)] {
        let half_turn = Quaternion::from_parts(0.0, Vector3::from(parts));
        for to in [half_turn, -half_turn] {
            let to = UnitQuaternion::new_unchecked(to);
            let middle = UnitQuaternion::interpolate(&UnitQuaternion::identity(), &to, share(WHOLE / 2));
            let expected = about(parts, sign * FRAC_PI_2);
            assert!(apart(&matrix(&middle), &expected) < ERROR_MAX, "{to}: {middle}");
        }
    }
}

proptest! {
    #[test]
    fn headings_go_the_short_way_round(from_rad in -20.0..20.0f64, turn_rad in -3.1..3.1f64, part in 0..=WHOLE) {
        let found = f64::turn(&from_rad, &(from_rad + turn_rad), share(part));
        prop_assert!(found > -PI - ERROR_MAX && found <= PI);
        // On the unit circle there is no seam.
        let expected_rad = from_rad + turn_rad * part as f64 / WHOLE as f64;
        prop_assert!((found.sin() - expected_rad.sin()).abs() < ERROR_MAX);
        prop_assert!((found.cos() - expected_rad.cos()).abs() < ERROR_MAX);
        let turned = UnitComplex::interpolate(
            &UnitComplex::new(from_rad), &UnitComplex::new(from_rad + turn_rad), share(part));
        prop_assert!((turned.re - expected_rad.cos()).abs() < ERROR_MAX);
        prop_assert!((turned.im - expected_rad.sin()).abs() < ERROR_MAX);
    }

    #[test]
    fn a_heading_crosses_the_seam(near_rad in 0.001..0.5f64, beyond_rad in 0.001..0.5f64, part in 0..=WHOLE) {
        let gone = (near_rad + beyond_rad) * part as f64 / WHOLE as f64;
        for side in [1.0, -1.0] {
            let found = f64::turn(&(side * (PI - near_rad)), &(side * (beyond_rad - PI)), share(part));
            let expected_rad = if gone <= near_rad { PI - near_rad + gone } else { gone - near_rad - PI };
            prop_assume!((gone - near_rad).abs() > ERROR_MAX);
            prop_assert!((found - side * expected_rad).abs() < ERROR_MAX, "{} {}", found, side * expected_rad);
        }
    }

    #[test]
    fn positions_go_straight(from in [-1e3..1e3f64, -1e3..1e3, -1e3..1e3], to in [-1e3..1e3f64, -1e3..1e3, -1e3..1e3],
        part in 0..=WHOLE)
    {
        let weight = part as f64 / WHOLE as f64;
        let expected: [f64; 3] = std::array::from_fn(|i| (1.0 - weight) * from[i] + weight * to[i]);
        let is_right = |found: [f64; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < ERROR_MAX);
        prop_assert!(is_right(<[f64; 3]>::interpolate(&from, &to, share(part))));
        prop_assert!(is_right(Vector3::interpolate(&from.into(), &to.into(), share(part)).into()));
        prop_assert!(is_right(Point3::interpolate(&from.into(), &to.into(), share(part)).into()));
        let moved = Translation3::interpolate(&from.into(), &to.into(), share(part));
        prop_assert!(is_right(moved.vector.into()));
    }

    /// `R(t) = R(0) exp(t log(R(0)ᵀ R(1)))`, with matrices.
    #[test]
    fn rotations_turn_at_a_constant_rate_the_short_way(
        first in axis(), first_rad in -3.0..3.0f64, about_axis in axis(),
        turn_rad in prop_oneof![-0.9999 * PI..0.9999 * PI, -1e-7..1e-7, Just(0.0)],
        part in 0..=WHOLE, flipped in any::<[bool; 2]>(),
    ) {
        let start = quaternion(first, first_rad);
        let end = start * quaternion(about_axis, turn_rad);
        let flip = |q: UnitQuaternion<f64>, is_flipped: bool| {
            if is_flipped { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
        };
        let found = UnitQuaternion::interpolate(&flip(start, flipped[0]), &flip(end, flipped[1]), share(part));
        let gone_rad = turn_rad * part as f64 / WHOLE as f64;
        let expected = product(&about(first, first_rad), &about(about_axis, gone_rad));
        prop_assert!(apart(&matrix(&found), &expected) < ERROR_MAX, "{found}");
        prop_assert!((found.norm() - 1.0).abs() < 1e-9);
        // Never further from the start than the whole way is.
        let way = product(&transposed(&about(first, first_rad)), &matrix(&found));
        let angle_rad = ((way[0][0] + way[1][1] + way[2][2] - 1.0) / 2.0).clamp(-1.0, 1.0).acos();
        prop_assert!(angle_rad <= turn_rad.abs() + 1e-6);
    }

    #[test]
    fn motions_move_and_turn(
        from_m in -9.0..9.0f64, to_m in -9.0..9.0f64, turn_rad in -3.0..3.0f64, part in 0..=WHOLE,
    ) {
        let weight = part as f64 / WHOLE as f64;
        let expected_m = (1.0 - weight) * from_m + weight * to_m;
        let plane = |x_m, angle_rad| Isometry2::new(Vector2::new(x_m, 1.0), angle_rad);
        let found = Isometry2::interpolate(&plane(from_m, 0.4), &plane(to_m, 0.4 + turn_rad), share(part));
        prop_assert!((found.translation.x - expected_m).abs() < ERROR_MAX);
        prop_assert!((found.rotation.re - (0.4 + weight * turn_rad).cos()).abs() < ERROR_MAX);
        let room = |z_m, angle_rad| Isometry3::new(Vector3::new(0.0, 0.0, z_m), Vector3::new(0.0, angle_rad, 0.0));
        let found = Isometry3::interpolate(&room(from_m, 0.0), &room(to_m, turn_rad), share(part));
        prop_assert!((found.translation.z - expected_m).abs() < ERROR_MAX);
        prop_assert!(apart(&matrix(&found.rotation), &about([0.0, 1.0, 0.0], weight * turn_rad)) < ERROR_MAX);
    }
}
