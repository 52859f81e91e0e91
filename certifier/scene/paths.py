"""Relative paths start beside a file as it was named, also where that is a symbolic link. Readers of robots do so, too."""

from __future__ import annotations

import os
from pathlib import Path

from certifier.errors import SceneError


def beside(directory: Path, reference: str) -> Path:
    """Returns the absolute path of a reference that starts at a directory. No symbolic link in it is followed.

    Raises:
        SceneError: ``scene_model``, where ``..`` follows a symbolic link. Drake goes up from the link there, and the operating system
            from what the link leads to.
    """
    written = os.path.join(directory, reference)
    path = os.path.abspath(written)
    if os.path.realpath(written) != os.path.realpath(path):
        message = f"{reference[:200]!a} goes up by .. from a symbolic link, and readers disagree about where that leads"
        raise SceneError(
            "scene_model", message, field="directives", hint="name the directory under packages, and write package://NAME/FILE"
        )
    return Path(path)
