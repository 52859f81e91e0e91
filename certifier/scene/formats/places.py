"""Places in the bytes of an XML file, and how to write something else there: every line keeps its number."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

_NAME = re.compile(rb"<[^\s/>]+")
_ATTRIBUTE = re.compile(rb"\s+([^\s=/>\"']+)\s*=\s*(\"[^\"]*\"|'[^']*')")
_END = re.compile(rb"\s*(/?)>")


@dataclass(frozen=True)
class Place:
    """A place is what stands from one byte to another one, which is not part of it.

    Attributes:
        quoted: whether it is the value of an attribute, with its quotes.
    """

    start: int
    end: int
    quoted: bool = False


@dataclass(frozen=True)
class _Tag:
    """A start tag: the places of its attributes' values, where it ends, and whether the element ends with it."""

    values: dict[str, Place]
    end: int
    empty: bool


def value_at(data: bytes, start: int, attribute: str) -> Place:
    """Returns the place of the value of an attribute that the element has whose tag starts at a byte."""
    return _tag(data, start).values[attribute]


def text_at(data: bytes, start: int, end_tag: int) -> Place:
    """Returns the place of all that an element holds.

    Args:
        start: the byte at which its start tag begins.
        end_tag: that of its end tag.
    """
    tag = _tag(data, start)
    return Place(tag.end, tag.end if tag.empty else end_tag)


def element_at(data: bytes, start: int, end_tag: int) -> Place:
    """Returns the place of an element with all that it holds; the arguments are those of :func:`text_at`."""
    tag = _tag(data, start)
    return Place(start, tag.end if tag.empty else data.index(b">", end_tag) + 1)


def changed(data: bytes, changes: Iterable[tuple[Place, str | None]]) -> bytes:
    """Returns the data with other texts in some places, which do not overlap; None leaves spaces in a place."""
    pieces, last = [], 0
    for place, text in sorted(changes, key=lambda change: change[0].start):
        before = data[place.start : place.end]
        if text is None:
            instead = re.sub(rb"[^\r\n]", b" ", before)
        else:
            instead = (quoteattr(text) if place.quoted else escape(text)).encode() + b"\n" * before.count(b"\n")
        pieces += [data[last : place.start], instead]
        last = place.end
    return b"".join([*pieces, data[last:]])


def _tag(data: bytes, start: int) -> _Tag:
    name = _NAME.match(data, start)
    assert name, "expat found a tag there"
    at, values = name.end(), {}
    while (found := _ATTRIBUTE.match(data, at)) is not None:
        values[found[1].decode(errors="replace")] = Place(found.start(2), found.end(2), quoted=True)
        at = found.end()
    end = _END.match(data, at)
    assert end, "expat found the end of the tag there"
    return _Tag(values, end.end(), bool(end[1]))
