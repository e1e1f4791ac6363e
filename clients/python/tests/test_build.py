"""The package is never built without its part in Rust by accident, and says where that does not load."""

from __future__ import annotations

import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from typing import Any
from unittest import mock

import rohrpost

FOLDER = pathlib.Path(__file__).parents[1]


def backend() -> Any:
    spec = importlib.util.spec_from_file_location("rohrpost_build", FOLDER / "backend" / "rohrpost_build.py")
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


class Builds(unittest.TestCase):
    def test_what_is_missing_for_the_part_in_rust_is_told(self) -> None:
        with mock.patch.dict(os.environ, {"ROHRPOST_PURE": ""}), mock.patch.object(sys, "platform", "linux"):
            build = backend()
            with mock.patch.object(build.shutil, "which", return_value=None):
                with self.assertRaisesRegex(RuntimeError, "no `cargo` in PATH.* set ROHRPOST_PURE=1"):
                    build.get_requires_for_build_wheel()
            with mock.patch.object(build, "_FOLDER", pathlib.Path("/x")):
                for hook in (build.get_requires_for_build_wheel, lambda: build.build_wheel("/nowhere")):
                    with self.assertRaisesRegex(RuntimeError, "/ is no copy of the repository"):
                        hook()
            with mock.patch.object(build.sysconfig, "get_config_var", return_value=1):
                with self.assertRaisesRegex(RuntimeError, "is free-threaded.* set ROHRPOST_PURE=1"):
                    build.get_requires_for_build_wheel()
            with mock.patch.object(build.shutil, "which", return_value="/bin/cargo"):
                self.assertRegex(build.get_requires_for_build_wheel()[0], "^maturin")
        for platform, pure in (("linux", "1"), ("darwin", "")):
            with mock.patch.dict(os.environ, {"ROHRPOST_PURE": pure}), mock.patch.object(sys, "platform", platform):
                self.assertRegex(backend().get_requires_for_build_wheel()[0], "^hatchling")

    def test_a_part_in_rust_that_does_not_load_is_told(self) -> None:
        with tempfile.TemporaryDirectory() as place:
            package = pathlib.Path(place) / "rohrpost"
            package.mkdir()
            for entry in pathlib.Path(rohrpost.__file__).parent.iterdir():
                if not entry.name.startswith(("_node.", "__pycache__")):
                    (package / entry.name).symlink_to(entry)
            (package / "_node.abi3.so").write_bytes(b"no library")
            told = (
                "import rohrpost as rp; print(rp.is_available())\n"
                "class M(rp.Module, klass='m'): ...\n"
                "try: rp.run(M)\n"
                "except rp.Misuse as error: print(error)"
            )
            said = subprocess.run(
                [sys.executable, "-B", "-c", told], env={**os.environ, "PYTHONPATH": place}, capture_output=True,
                text=True, check=True,
            )  # fmt: skip
        self.assertRegex(said.stdout, "^False\nthe part of this package that is Rust does not load.*_node.abi3.so")


if __name__ == "__main__":
    unittest.main()
