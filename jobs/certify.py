"""A job that certifies a given polytope: one outcome for each pair."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from certifier.errors import RegionError
from certifier.growth.actions import Finish
from certifier.growth.options import CertifyOptions
from certifier.model import Polytope, Scene
from certifier.outcome import Outcome
from certifier.positions import check_magnitude
from certifier.words import counted
from db.session import Database
from jobs.checks import check_length
from jobs.fields import Offsets, Request, Rows, Vector, model_of
from jobs.growing import Growing
from jobs.request import JobRequest


class PolytopeBody(Request):
    """Describes the polytope {s : C s <= d}. The service always adds the joint limits."""

    C: Rows = Field(description="(m, n), one row a face, in s, with the joints in position order.")
    d: Offsets = Field(description="(m,), the right-hand sides of the faces.")
    center: Vector | None = Field(None, description="(n,), an interior point, in s; the service finds one if none is given.")


class CertifyRequest(JobRequest, model_of(CertifyOptions)):  # type: ignore[misc]
    """Asks for one outcome for each pair on a given polytope."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "certify", "scene": "planar-2dof", "polytope": {"C": [[1, 0], [-1, 0]], "d": [0.1, 0.1]}}]}
    )

    kind: Literal["certify"] = Field(description="The kind of the job.")
    polytope: PolytopeBody = Field(description="The polytope to certify.")


class Certify(Growing):
    """Finds one outcome for each pair on a given polytope. The job succeeds with any of them."""

    name = "certify"
    request = CertifyRequest
    forms: ClassVar = {"": ("Certification", CertifyOptions)}

    def options(self, body: CertifyRequest, scene: Scene, db: Database) -> dict[str, Any]:
        given = body.polytope
        for i, row in enumerate(given.C):
            check_length(scene, row, f"polytope.C[{i}]", "polytope_shape")
        if len(given.C) != len(given.d):
            problem = f"C has {counted(len(given.C), 'row')} and d has {counted(len(given.d), 'number')}"
            raise RegionError("polytope_shape", problem, field="polytope.d", hint="give one number a row")
        Polytope.given(given.C, given.d, scene.n)
        if given.center is not None:
            check_length(scene, given.center, "polytope.center", "polytope_shape")
            check_magnitude(given.center, "polytope.center")
            if not scene.polytope(given.C, given.d).contains(given.center):
                problem, hint = "the centre is not inside the polytope and the joint limits", "leave it out to have one found"
                raise RegionError("center_outside", problem, field="polytope.center", hint=hint)
        return {"kind": "certify", "seed": given.model_dump(exclude_none=True), "cells": body.cells, "random_seed": body.random_seed}

    def failure(self, finish: Finish, error: dict[str, Any] | None) -> dict[str, Any] | None:
        return super().failure(finish, error) if finish.outcome is Outcome.ERROR else None
