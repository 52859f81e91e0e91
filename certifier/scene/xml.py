"""Expat reads XML here, and document types are refused: entity bombs are made of them, and Drake would not replace an entity."""

from __future__ import annotations

from collections.abc import Callable
from xml.parsers import expat

from certifier.errors import SceneError


def parse_xml(data: bytes, name: str, code: str, install: Callable[[expat.XMLParserType], None]) -> None:
    """Runs expat over the content of a file.

    Args:
        name: the file's name for people.
        code: the code of the errors.
        install: sets the parser's handlers, before anything is read.

    Raises:
        SceneError: with ``code``, for XML in UTF-16, and with the line for XML that is broken or declares a document type; or whatever the
            handlers raise.
    """
    if b"\0" in data:
        message = f"{name}: the file is in UTF-16 or UTF-32, which Drake does not read"
        raise SceneError(code, message, field="directives", hint="save the file as UTF-8")
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        message = f"{name}:{parser.CurrentLineNumber}: the file declares a document type or entity"
        raise SceneError(code, message, field="directives", hint="remove it, and write out what the entities stand for")

    install(parser)
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        message = f"{name}:{error.lineno}: this is not XML: {expat.ErrorString(error.code)}"
        raise SceneError(code, message, field="directives", hint="mend the file there") from None
