"""This module grows and certifies in this process, without a service."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from certifier.configurations import positions
from certifier.errors import CirisError, SceneError
from certifier.growth.options import CertifyOptions, GrowthOptions, RecertifyOptions
from certifier.isolation.child import prepare
from certifier.jobs.options import JobOptions
from certifier.model import Scene
from certifier.options import Options, read, table
from certifier.seeding import PROPOSE
from ciris.documents import Document
from client import verdicts
from client.cores import cores
from client.follow import Teller
from client.inputs import Given, is_scene_file
from client.output import Screen
from client.polytopes import PolytopeFile
from client.service import Grown

if TYPE_CHECKING:
    from certifier.jobs.region import Region


def load(scene: str) -> Scene:
    """Returns the scene of a scene file, about which something is to be proved.

    Raises:
        SceneError: scene_not_found for a name that only a service could know, no_pairs, or what is wrong with the file.
    """
    check_is_file(scene)
    from certifier.scene import load_scene

    loaded = load_scene(scene)
    loaded.check_pairs()
    return loaded


def positions_of(scene: Scene, given: Given, field: str) -> list[float]:
    """Returns joint positions, (n,), that were given or that the names of configurations stand for.

    Raises:
        RegionError: as :func:`certifier.configurations.positions`.
    """
    joints, q_star = [joint.name for joint in scene.moving], scene.q_star.tolist()
    return positions(given, scene.configurations, joints, q_star, field) if isinstance(given, str) else given


def check_is_file(scene: str) -> None:
    """Refuses a name that only a service could know.

    Raises:
        SceneError: scene_not_found.
    """
    if not is_scene_file(scene):
        raise SceneError("scene_not_found", f"{scene!r} is not a scene file", field="SCENE", hint="--local needs the path of a .yaml file")


def grow(scene: str, asked: Document, screen: Screen, watch: bool, keep: Callable[[str, bytes], Path]) -> Grown:
    """Grows a region in this process and children of it.

    Args:
        asked: the seed and the options of the request.
        keep: writes the proof of a region of the scene with this name; it is called for regions that are certified before the last one too.
    """
    check_is_file(scene)
    prepare(PROPOSE)  # which loads beside the scene
    loaded = load(scene)
    from certifier.jobs import local

    seed = {**asked["seed"], "q": positions_of(loaded, asked["seed"]["q"], "seed.q")}
    if "contain" in seed:
        seed["contain"] = [positions_of(loaded, q, f"seed.contain[{i}]") for i, q in enumerate(seed["contain"])]
    options = GrowthOptions.from_document({"kind": "grow", "seed": seed, **asked["options"]})

    def deliver(region: Region) -> None:
        screen.line(f"its proof: {keep(loaded.name, region.proof)}")

    region = local.grow(loaded, options, _teller(loaded, screen, watch), _read(JobOptions, asked).deadline_seconds, cores(), deliver)
    screen.clear()
    return Grown(region.manifest, region.proof, region.manifest["provenance"]["seconds"], remark=region.reason)


def recertify(data: bytes, scene: str, keep: list[Given] | None, asked: Document, screen: Screen, watch: bool) -> Grown:
    """Certifies a region of the scene before it changed again, in this process and children of it.

    Args:
        data: the proof file of the region.
        keep: as for :func:`certifier.jobs.local.recertify`.
        asked: the options of the request.
    """
    loaded = load(scene)
    from certifier.jobs import local

    deadline, seed = _read(JobOptions, asked).deadline_seconds, _read(RecertifyOptions, asked).random_seed
    inside = None if keep is None else [positions_of(loaded, q, "--q") for q in keep]
    region = local.recertify(loaded, data, inside, _teller(loaded, screen, watch), deadline, cores(), seed)
    screen.clear()
    return Grown(region.manifest, region.proof, region.manifest["provenance"]["seconds"], remark=region.reason)


def _read(cls: type[Options], asked: Document) -> Options:
    """Returns those options of a request that a dataclass has.

    Raises:
        RegionError: option_value.
    """
    names = {one.name for one in table(cls)}  # type: ignore[arg-type]
    return read(cls, {name: value for name, value in asked.items() if name in names}, "")


def _teller(scene: Scene, screen: Screen, watch: bool) -> Callable[[str, dict[str, Any]], None]:
    """Returns what tells people of a job of this process, in the words in which they hear of one of the service."""
    teller = Teller(screen, [f"{pair.a} - {pair.b}" for pair in scene.pairs], watch)
    return lambda kind, data: teller.tell({"kind": kind, "data": data})


def certify(
    scene: str, given: PolytopeFile, asked: Document, screen: Screen, watch: bool, drake: str | None, prove: bool = False
) -> tuple[dict[str, Any], Sequence[str], bytes | None]:
    """Certifies a polytope in this process.

    Returns:
        the document of ``ciris certify --json``; the units of joint positions, (n,); and the proof, where that is asked for (``prove``) and
        the polytope is certified.

    Args:
        asked: the options of the request, for our certifier.
        drake: name of the solver with which Drake is asked instead; None asks our certifier.

    Raises:
        CirisError: option, for a deadline.
    """
    how = _read(CertifyOptions, asked)
    if _read(JobOptions, asked).deadline_seconds is not None:
        raise CirisError(
            "option", "a polytope is certified here without a deadline", field="--deadline", hint="leave out --deadline or --local"
        )
    loaded = load(scene)
    given.check_space([joint.name for joint in loaded.moving], loaded.q_star.tolist())
    tell = _teller(loaded, screen, watch)
    if drake is None:
        from certifier.jobs import local

        verdict = local.certify(loaded, given.polytope, given.center, tell, how.cells, cores(), prove, how.random_seed)
    else:
        from certifier.jobs import reference

        verdict = reference.certify(loaded, given.polytope, drake, screen.line if watch else screen.status)
    screen.clear()
    pairs = [
        {
            **vars(result),
            "a": loaded.pairs[index].a,
            "b": loaded.pairs[index].b,
            "witness_q": None if result.witness_s is None else loaded.to_q(result.witness_s).tolist(),
        }
        for index, result in sorted(verdict.results.items())
    ]
    document = verdicts.document(loaded.name, loaded.hash, verdict.outcome, verdict.guarantee, verdict.seconds, pairs)
    return document, loaded.units, None if verdict.region is None else verdict.region.proof
