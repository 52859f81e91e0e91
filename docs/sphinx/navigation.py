"""This extension makes the site's navigation from the headings and links of docs/index.md, so that the page is written once."""

import re

from sphinx.application import Sphinx

LINK = re.compile(r"\]\(((?:\.\./|reference/)?[\w.]+\.md)\)")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", _with_toctrees)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _with_toctrees(app: Sphinx, page: str, content: list[str]) -> None:
    if page != app.config.root_doc:
        return
    trees = []
    for section in content[0].split("\n## ")[1:]:
        title, _, text = section.partition("\n")
        pages = dict.fromkeys(f"/{path.removeprefix('../')}" if path.startswith("../") else path for path in LINK.findall(text))
        trees.append("\n".join([f"```{{toctree}}\n:hidden:\n:caption: {title}\n", *pages, "```"]))
    content[0] = "\n\n".join([content[0], *trees])
