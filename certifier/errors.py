"""The errors here tell a user what is wrong, where, and what to do."""

import difflib
from functools import partial

LONGEST = 1000
"""What an error says is cut in the middle where it is longer: it may contain a name that a user gave."""


def shortened(text: str) -> str:
    """Returns a text without its middle, where it is longer than LONGEST."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 500]} [...] {text[-400:]}"


class CirisError(Exception):
    """This error reports a problem that the user can mend.

    Attributes:
        code: stable machine-readable name, e.g. ``"seed_in_collision"``.
        field: where in the user's input the problem is, e.g. ``"seed.q[3]"``; None when the input as a whole is meant.
        hint: what to do about it; may be empty.
    """

    def __init__(self, code: str, message: str, *, field: str | None = None, hint: str = "") -> None:
        super().__init__(message)
        self.code, self.message, self.field, self.hint = code, shortened(message), field and shortened(field), shortened(hint)

    def __str__(self) -> str:
        where = f"{self.field}: " if self.field else ""
        return f"{where}{self.message}" + (f" ({self.hint})" if self.hint else "")

    def __reduce__(self) -> tuple[object, ...]:
        """Says how the error travels between processes, and how it is copied."""
        return partial(type(self), field=self.field, hint=self.hint), (self.code, self.message)

    def to_document(self) -> dict[str, str | None]:
        """Returns the error as a JSON-able dict with the keys code, message, field, hint."""
        return {"code": self.code, "message": self.message, "field": self.field, "hint": self.hint}

    @classmethod
    def from_document(cls, document: dict[str, str | None]) -> "CirisError":
        """Does the inverse of :meth:`to_document`; the result is a plain CirisError."""
        return cls(document["code"] or "error", document["message"] or "", field=document["field"], hint=document["hint"] or "")


class SceneError(CirisError):
    """The scene cannot be used: a file is broken, a joint or a shape is not supported, or a name is unknown."""


class RegionError(CirisError):
    """The polytope or the seed cannot be used: it is empty, unbounded, in collision, outside the limits, or of the wrong length."""


class ProofError(CirisError):
    """The proof does not hold, or the file is not a proof."""


def unreadable(error: OSError) -> str:
    """Returns why a file cannot be read or written, for people."""
    match error:
        case FileNotFoundError():
            return "there is no such file or directory"
        case IsADirectoryError():
            return "it is a directory"
        case PermissionError():
            return "you may not read or write it"
        case _:
            return (error.strerror or str(error)).lower()


def close_matches(name: str, known: list[str]) -> str:
    """Returns a hint with the known names that are most like ``name``; the hint is empty when none is like it."""
    tails = {k.rsplit("/", 1)[-1]: k for k in known}
    matches = difflib.get_close_matches(name, known, n=3) or [
        tails[t] for t in difflib.get_close_matches(name.rsplit("/", 1)[-1], list(tails), n=3)
    ]
    return f"did you mean {' or '.join(matches)}?" if matches else ""
