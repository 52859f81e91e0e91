"""Scene files and bundles -> Scene."""

from certifier.scene.load import load_scene

__all__ = ["load_scene"]
