"""Every link between the pages leads somewhere: to a file of the repository, and to a heading of it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```$|^ {4}[^\n]*$|`[^`\n]+`(?!\])", re.MULTILINE | re.DOTALL)


def links(page: Path) -> list[str]:
    """The links of a page that lead to files or headings of the repository."""
    found = LINK.findall(CODE.sub("", page.read_text()))
    return [link for link in found if "://" not in link and re.match(r"#|[\w./-]+(#|$)", link) and ("." in link or "#" in link)]


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and the site make them."""
    titles = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in links(page):
        path, _, anchor = link.partition("#")
        target = page if not path else page.parent / path
        assert target.exists(), link
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), link


def test_every_page_is_listed() -> None:
    index = ROOT / "docs" / "index.md"
    listed = {(index.parent / link.partition("#")[0]).resolve() for link in links(index)}
    assert {page for page in PAGES if page.is_relative_to(index.parent)} - listed <= {index}


def test_the_workflow_runs_what_there_is() -> None:
    for command in re.findall(r"- run: ((?:\.ci|docs)/\w+)$", (ROOT / ".github/workflows/check.yml").read_text(), re.MULTILINE):
        assert (ROOT / command).stat().st_mode & 0o111, command
