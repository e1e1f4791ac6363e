"""Builds this package: with its part in Rust where that can be, else without.

On Linux, in a copy of the repository and with Rust installed, `maturin` builds a wheel with `rohrpost._node`, which
modules on the node need. On other systems, and with ``ROHRPOST_PURE=1``, the wheel has ``rohrpost.remote`` alone. On
Linux it is never so by accident: what is missing is told.
"""

from __future__ import annotations

import os
import pathlib
import shutil
import sys
import sysconfig
from typing import Any

_FOLDER = pathlib.Path(__file__).resolve().parent.parent
_MATURIN, _HATCHLING = "maturin>=1.9,<2", "hatchling>=1.18"


def _has_rust() -> bool:
    """Whether the part in Rust belongs to what is built here."""
    return sys.platform == "linux" and os.environ.get("ROHRPOST_PURE", "") in ("", "0")


def _require_rust() -> None:
    """Raises an exception with what is missing to build it."""
    root = _FOLDER.parent.parent
    if not (root / "clients" / "native" / "Cargo.toml").is_file():
        missing = f"{root} is no copy of the repository of Rohrpost, of which it is a part"
    elif sysconfig.get_config_var("Py_GIL_DISABLED"):
        missing = "this interpreter is free-threaded, and its wheels are for those with a lock; take one without `t`"
    elif shutil.which("cargo") is None:
        missing = "there is no `cargo` in PATH; install Rust (https://rustup.rs)"
    else:
        return
    raise RuntimeError(
        f"the part in Rust of the package `rohrpost` cannot be built: {missing}. Without it a package has no modules "
        "on the node, `rohrpost.remote` alone: set ROHRPOST_PURE=1 if that is what you want"
    )


def _wheels() -> Any:
    if _has_rust():
        _require_rust()
        import maturin

        # It runs the program of its name, which is not on everybody's path.
        os.environ["PATH"] = os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", "")])
        return maturin
    import hatchling.build

    return hatchling.build


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """What has to be installed first."""
    if not _has_rust():
        return [_HATCHLING]
    _require_rust()
    return [_MATURIN]


if _has_rust():
    # Without this function a package is built to learn of it.
    def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Any = None) -> str:
        """The package's description."""
        name: str = _wheels().prepare_metadata_for_build_wheel(metadata_directory, config_settings)
        return name


def build_wheel(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    """Builds it; the name of the file."""
    name: str = _wheels().build_wheel(wheel_directory, config_settings, metadata_directory)
    return name


def get_requires_for_build_sdist(config_settings: Any = None) -> list[str]:
    """What has to be installed first."""
    return [_HATCHLING]


def build_sdist(sdist_directory: str, config_settings: Any = None) -> str:
    """Sources, from which a package without its part in Rust is built."""
    import hatchling.build

    name: str = hatchling.build.build_sdist(sdist_directory, config_settings)
    return name
