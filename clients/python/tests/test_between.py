"""Values between two others."""

from __future__ import annotations

import math
import unittest
from typing import Annotated, Any, Optional

import rohrpost as rp
from rohrpost.annotations import type_of
from rohrpost.between import between


@rp.data
class Wrist:
    turn_rad: Annotated[rp.F32, rp.said(unit="rad")]
    joints: Annotated[list[float], rp.Length(2)]
    pair: tuple[float, rp.U8]
    grip: Optional[float]
    count: rp.U64
    picture: bytes


def _single(value: float) -> float:
    return float(f"{value:.6f}")


class Between(unittest.TestCase):
    def value(self, start: Any, end: Any, share: float, annotation: Any = float, unit: str = "") -> Any:
        return between(type_of(annotation, "value"), unit, start, end, share)

    def test_odometry_goes_straight_and_its_heading_the_short_way(self) -> None:
        def odometry(x_m: float, heading_rad: float, turn_rate_rad_s: float) -> rp.Odometry:
            return rp.Odometry(rp.Pose(x_m, -2.0, heading_rad), rp.Twist(0.5, turn_rate_rad_s))

        found = self.value(odometry(1.0, 3.0, 0.0), odometry(2.0, -3.0, 0.4), 0.75, rp.Odometry)
        self.assertIsInstance(found, rp.Odometry)
        self.assertAlmostEqual(found.pose.x_m, 1.75)
        self.assertAlmostEqual(found.pose.heading_rad, 3.0 + 0.75 * (math.tau - 6.0) - math.tau)
        self.assertAlmostEqual(found.twist.turn_rate_rad_s, 0.3, msg="a rate is no heading")

    def test_what_has_no_values_in_between_comes_from_the_nearer_one(self) -> None:
        start = Wrist(3.1, [0.0, 1.0], (0.0, 1), None, 7, b"a")
        end = Wrist(-3.1, [1.0, 3.0], (1.0, 2), 0.5, 9, b"b")
        early, late = (self.value(start, end, share, Wrist) for share in (0.5, 0.75))
        self.assertEqual((early.pair, early.grip, early.count, early.picture), ((0.5, 1), None, 7, b"a"))
        self.assertEqual((late.pair, late.grip, late.count, late.picture), ((0.75, 2), 0.5, 9, b"b"))
        self.assertEqual((early.joints, late.joints), ([0.5, 2.0], [0.75, 2.5]))
        self.assertEqual(_single(late.turn_rad), _single(3.1 + 0.75 * (math.tau - 6.2) - math.tau))

    def test_a_unit_outside_holds_for_what_is_inside_and_a_value_without_a_class_is_a_dict(self) -> None:
        self.assertEqual(self.value(3.0, -3.0, 0.5), 0.0)
        self.assertAlmostEqual(abs(self.value(3.0, -3.0, 0.5, unit="rad")), math.pi)
        start, end = ({"x_m": x_m, "y_m": 0.0, "heading_rad": 0.0} for x_m in (1.0, 2.0))
        described = rp.schema.tree.Struct(type_of(rp.Pose, "pose").named)  # type: ignore[union-attr]
        self.assertEqual(between(described, "", start, end, 0.25), {"x_m": 1.25, "y_m": 0.0, "heading_rad": 0.0})

    def test_numbers_that_are_none_do_no_harm(self) -> None:
        for unit in ("", "rad"):
            self.assertTrue(math.isnan(self.value(math.inf, -math.inf, 0.5, unit=unit)), unit)
            self.assertTrue(math.isnan(self.value(math.nan, 1.0, 0.5, rp.F32, unit)), unit)
