//! Angles that meet themselves after a turn.

use std::f64::consts::{PI, TAU};

/// The same direction within (-π, π].
///
/// ```
/// use rohrpost_fusion::wrap_rad;
/// assert!((wrap_rad(1.5 * std::f64::consts::PI) + 0.5 * std::f64::consts::PI).abs() < 1e-12);
/// ```
pub fn wrap_rad(angle_rad: f64) -> f64 {
    let turned = angle_rad.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn half_a_turn_is_positive() {
        for (angle_rad, wrapped_rad) in [(PI, PI), (-PI, PI), (3.0 * PI, PI), (0.0, 0.0), (TAU, 0.0)] {
            assert!((wrap_rad(angle_rad) - wrapped_rad).abs() < 1e-12, "{angle_rad}");
        }
    }

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction(angle_rad in -1e4..1e4) {
            let wrapped = wrap_rad(angle_rad);
            prop_assert!(wrapped > -PI - 1e-12 && wrapped <= PI);
            prop_assert!((wrapped.sin() - angle_rad.sin()).abs() < 1e-9);
            prop_assert!((wrapped.cos() - angle_rad.cos()).abs() < 1e-9);
        }
    }
}
