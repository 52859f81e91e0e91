"""How Sphinx builds the pages as a site (``docs/site``). Its sources are the pages of the repository as they stand."""

import logging
import sys
from importlib import metadata
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
logging.getLogger("alembic").setLevel(logging.WARNING)
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

project = "ciris"
release = metadata.version("ciris")
root_doc = "docs/index"
include_patterns = ["CONTRIBUTING.md", "CHANGELOG.md", "docs/*.md", "docs/reference/*.md"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "navigation", "openapi"]

myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline"]
suppress_warnings = ["myst.header", "misc.highlighting_failure", "myst.xref_ambiguous"]  # the last: [a; b](s) in a formula is no link

autodoc_default_options = {"members": True, "show-inheritance": True, "member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = f"ciris {release}"
html_favicon = "../../dashboard/static/icon.svg"
html_show_sourcelink = False
html_copy_source = False


def setup(app: Sphinx) -> None:
    app.connect("autodoc-process-docstring", _plain)


def _plain(app: Sphinx, what: str, name: str, of: object, options: object, lines: list[str]) -> None:
    """Keeps the bars of mathematics, such as those of |a|, because docstrings have no substitutions."""
    lines[:] = [line.replace("|", "\\|") for line in lines]
