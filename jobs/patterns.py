"""The patterns that texts of requests must match, and what to say of a text that does not."""

from __future__ import annotations

from db import projects

ANY = r"^[^\x00]*$"
SOMETHING = r"^[^\x00]+$"
LABEL = r"^[^=\x00]+=[^\x00]*$"
LABEL_NAME = r"^[\w./-]+$"
KEY_NAME = f"^{projects.NAME.pattern}$"
WEBHOOK_URL = r"^https?://"
WEBHOOK_SECRET = r"^whsec_[A-Za-z0-9+/]{32,88}={0,2}$"

SAID = {
    ANY: "it must hold no zero byte",
    SOMETHING: "it must hold no zero byte, and not be empty",
    LABEL: "it must be a label, NAME=VALUE",
    LABEL_NAME: "the name of a label has letters, digits and . _ / - only",
    KEY_NAME: "a name has up to 64 letters, digits and . _ - @, and begins with a letter, a digit or _",
    WEBHOOK_URL: "it must begin with http:// or https://",
    WEBHOOK_SECRET: "it must be `whsec_` and the base64 of 24 to 64 bytes",
}
