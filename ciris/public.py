"""Everything that ``import ciris`` offers."""

from certifier.errors import CirisError
from certifier.outcome import Guarantee, Outcome
from ciris.answers import Containment, Cover, Coverage, Event, Graph, Map, Motion, Nearest, Obstacle, Plan, Segments, Verification
from ciris.asynchronous.service import AsyncJob, AsyncRegion, AsyncService
from ciris.connecting import connect, connect_async
from ciris.free_set import Closest, FreeSet, OpenPart
from ciris.scene import Scene
from ciris.space import Space
from ciris.synchronous.service import Job, Region, Service

__all__ = [
    "AsyncJob",
    "AsyncRegion",
    "AsyncService",
    "CirisError",
    "Closest",
    "Containment",
    "Cover",
    "Coverage",
    "Event",
    "FreeSet",
    "Graph",
    "Guarantee",
    "Job",
    "Map",
    "Motion",
    "Nearest",
    "Obstacle",
    "OpenPart",
    "Outcome",
    "Plan",
    "Region",
    "Scene",
    "Segments",
    "Service",
    "Space",
    "Verification",
    "connect",
    "connect_async",
]
