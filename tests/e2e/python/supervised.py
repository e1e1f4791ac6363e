#!/usr/bin/env python3
"""A program that the wormhole supervises: creeps ahead, and plans only while it has control."""

import sys

sys.path.insert(0, "PACKAGE")
sys.dont_write_bytecode = True

import rohrpost as rp  # noqa: E402


class Pilot(rp.Module, klass="pilot", settings=("x-m", "y-m")):
    """Creeps ahead, with a destination further away."""

    def __init__(self) -> None:
        self.has_control = False
        self.planned = 0

    @rp.command(16)
    def plans(self) -> rp.U64:
        """How often it has planned."""
        return self.planned

    @rp.on_data("wormhole.0", "control")
    def control(self, state) -> None:
        self.has_control = state["mode"].name == "Active"

    @rp.every(0.05)
    def drive(self) -> None:
        wormhole = self.proxy("wormhole.0")
        try:
            wormhole.set_destination({"x_m": self.settings["x-m"], "y_m": self.settings["y-m"]})
            wormhole.promise(300, 0.05, 0.0)
        except rp.FunctionError:
            pass  # Blind as yet, or a person drives.
        # What it does for a good way; without control it needs none.
        self.planned += self.has_control


if __name__ == "__main__":
    rp.run(Pilot)
