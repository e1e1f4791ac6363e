"""Records as arrays of numpy, where that is installed, and the package with its part in Rust."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rohrpost as rp

CONFIG = """
installation = "test"
[system]
name = "test"
id = 1
[classes]
camera = { id = 198 }
looker = { id = 197 }
tool = { id = 16 }
[nodes.main]
[[module]]
name = "camera.0"
program = "camera"
[module.stream.image]
record = "64 KiB"
[module.stream.depth]
record = "64 KiB"
[module.stream.refused]
record = "1 KiB"
[module.stream.kinds]
record = "1 KiB"
[module.stream.pair]
record = "8 KiB"
[[module]]
name = "looker.0"
program = "looker"
calls = ["camera.0"]
"""
HAS_BOTH = importlib.util.find_spec("numpy") is not None and rp.is_available()


@unittest.skipUnless(HAS_BOTH, "without numpy, or without the part in Rust")
class Arrays(unittest.TestCase):
    def test_records_are_filled_from_arrays_and_looked_at_as_arrays_in_place(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            config, file = Path(folder, "robot.toml"), Path(folder, "told.json")
            config.write_text(CONFIG)
            program = [sys.executable, "-B", str(Path(__file__).with_name("arrays.py"))]
            memory = {**os.environ, "ROHRPOST_DIR": folder}
            started = [
                subprocess.Popen([*program, str(config), name, str(file)], env=memory, stderr=subprocess.PIPE)
                for name in ("camera.0", "looker.0")
            ]
            camera, looker = started
            try:
                _, said = looker.communicate(timeout=60)
            finally:
                for its in started:
                    its.kill()
                    its.communicate()
            self.assertTrue(file.is_file(), said.decode())
            told = json.loads(file.read_text())
        self.assertEqual(told["grey"], [0, 2, 128, 48 * 128 - 2], "every second column, of each row")
        self.assertEqual((told["flat"], told["mine"], told["metres"]), (["uint8", [6144]], [0, 2, 4], 0.5))
        self.assertFalse(told["is copied"])
        self.assertEqual((told["kinds"], told["pair"]), ([0, 1], [True, "memoryview"]))
        self.assertEqual(told["calls"], ["newest", "__init__"] * 2, "all else of a picture is done by Rust")
        self.assertRegex(told["write"], "^ValueError: assignment destination is read-only")
        self.assertRegex(told["kept"], "^Misuse: a view of record [0-9]+ of `image` of camera.0 is kept")
        self.assertEqual((told["leads"], told["again"]), ([6143], "no exception, but None"))
        of_array, of_write = told["refused"].split("; ", 1)
        self.assertRegex(of_array, "^(ValueError|NotImplementedError): ")
        self.assertRegex(of_write, r"^Misuse: Camera.image: value.pixels: expected ")


if __name__ == "__main__":
    unittest.main()
