"""How far the pairs of a scene are apart, by Drake alone.

Drake's signed distances do not come for minutes where the centre of a large ball lies on a vertex of a hull, and those of bodies that are
apart may be too large, by centimetres between boxes that are turned about one axis. So this is for random configurations, and for signs
rather than for distances.
"""

from __future__ import annotations

import numpy as np
from pydrake.geometry import QueryObject

from certifier.model import Array, Pair, Scene
from certifier.scene.drake_model import InDrake, build_diagram, geometry_name


class DrakesClearance:
    """Tells how far apart the pairs of a scene are, by Drake."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._diagram = build_diagram(scene)
        self._own = InDrake(scene, self._diagram.plant())
        self._context = self._diagram.CreateDefaultContext()
        inspector = self._diagram.scene_graph().model_inspector()
        self._ids = {geometry_name(inspector, g): g for g in inspector.GetAllGeometryIds()}
        self._reaches = {frozenset((self._ids[p.a], self._ids[p.b])): 2 * scene.padding_of(p) for p in scene.pairs}

    def least(self, q: Array) -> tuple[float, Pair]:
        """Returns the least distance of the padded bodies of a pair at q, (n,), in metres, and the pair.

        It is minus infinity where Drake cannot tell how deep two bodies are in each other.
        """
        query, ids = self._query(q), self._ids
        least, nearest = np.inf, self._scene.pairs[0]
        for pair in self._scene.pairs:
            try:
                apart = query.ComputeSignedDistancePairClosestPoints(ids[pair.a], ids[pair.b]).distance
            except RuntimeError:  # Drake gives up on some bodies that are deep in each other.
                return -np.inf, pair
            if (distance := apart - 2 * self._scene.padding_of(pair)) < least:
                least, nearest = distance, pair
        return float(least), nearest

    def free(self, q: Array, room: float = 0.0) -> bool:
        """Returns whether all pairs are farther apart at q, (n,), than twice the padding and the room, in metres."""
        try:
            near = self._query(q).ComputeSignedDistancePairwiseClosestPoints(2 * self._scene.largest_padding + room)
        except RuntimeError:  # as above
            return False
        return all(pair.distance > self._reaches[frozenset((pair.id_A, pair.id_B))] + room for pair in near)

    def _query(self, q: Array) -> QueryObject:
        self._diagram.plant().SetPositions(self._diagram.mutable_plant_context(self._context), self._own.at(q))
        found: QueryObject = (
            self._diagram.scene_graph().get_query_output_port().Eval(self._diagram.mutable_scene_graph_context(self._context))
        )
        return found
