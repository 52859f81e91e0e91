"""The registry has one object for each kind of job. A new kind is added here, and nowhere else is there a list of them."""

from __future__ import annotations

from jobs.certify import Certify
from jobs.certify_path import CertifyPath
from jobs.cover import Cover
from jobs.grow import Grow
from jobs.kind import Kind
from jobs.map import Map
from jobs.recertify import Recertify

KINDS: dict[str, Kind] = {kind.name: kind for kind in (Grow(), Certify(), Recertify(), CertifyPath(), Cover(), Map())}
"""name -> kind"""
