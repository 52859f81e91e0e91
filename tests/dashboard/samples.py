"""``python -m tests.dashboard.samples`` packs the examples that an empty service offers into dashboard/static/samples."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

from certifier.scene.bundle import pack_bundle

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "dashboard" / "static" / "samples"
NAMES = ("planar_2dof", "arm_3dof")


def files(data: bytes) -> dict[str, bytes]:
    """Returns path -> content of the files of a zip, which other machines compress otherwise."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def main() -> None:
    SAMPLES.mkdir(exist_ok=True)
    for name in NAMES:
        (SAMPLES / f"{name}.zip").write_bytes(pack_bundle(ROOT / "examples" / name / "scene.yaml"))


if __name__ == "__main__":
    main()
