"""What names and sentences from strangers may consist of, and how other text is shown: statements and messages print them."""

from __future__ import annotations

import re

MAX_NAME, MAX_SENTENCE = 200, 500
"""A name has at most MAX_NAME characters, and a sentence of free text has at most MAX_SENTENCE."""
ALPHABET = f"at most {MAX_NAME} ASCII letters, digits, _-./:+@#()[],= and single spaces inside"
"""This text tells people what a name may consist of (:func:`is_name`)."""
SCENE_ALPHABET = f"{ALPHABET}; neither 16 or 64 digits of 0-9a-f, nor . or .. between slashes"
"""This text tells people what a scene may be called (:func:`is_scene_name`)."""
_ID = re.compile(r"[0-9a-f]{16}|[0-9a-f]{64}")
_NAME = re.compile(r"[\w\-./:+@#()\[\],=]+(?: [\w\-./:+@#()\[\],=]+)*", re.ASCII)


def is_name(text: object) -> bool:
    """Returns whether a joint, a body or a geometry may have this name.

    A name consists of at most 200 ASCII letters, digits, characters of ``_-./:+@#()[],=`` and single spaces inside. Statements print
    names, so nothing in a name may look like another line or control a terminal.
    """
    return isinstance(text, str) and len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


def is_scene_name(text: object) -> bool:
    """Returns whether a scene may have this name: as :func:`is_name`, but not what looks like an id, and no path with ``.`` or ``..``.

    An id of a scene has 16 or 64 digits of 0-9a-f. Addresses of pages and requests contain names, and browsers resolve dots in them.
    """
    return is_name(text) and not looks_like_id(str(text)) and not {".", ".."} & set(str(text).split("/"))


def looks_like_id(text: str) -> bool:
    """Returns whether this may be the id of a scene."""
    return _ID.fullmatch(text) is not None


def is_sentence(text: object) -> bool:
    """Returns whether this may be a reason or a substitution: one line of at most 500 printable characters."""
    return isinstance(text, str) and len(text) <= MAX_SENTENCE and text.isprintable() and "  " not in text


def escaped(text: str) -> str:
    """Returns the text as one line for people. What is not printable, and the backslash, is written as Python escapes it."""
    return "".join(c if c.isprintable() and c != "\\" else c.encode("unicode_escape").decode() for c in text)
