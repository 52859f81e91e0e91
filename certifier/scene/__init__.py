"""Scene files and bundles are read into a Scene here."""

from certifier.scene.bundle import BundleLimits, load_bundle, pack_bundle
from certifier.scene.load import load_scene

__all__ = ["BundleLimits", "load_bundle", "load_scene", "pack_bundle"]
