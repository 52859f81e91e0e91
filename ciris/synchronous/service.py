"""What engineers import: the service, its jobs and its regions. It is made from the one in ``ciris.asynchronous``."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, Unpack
from weakref import WeakValueDictionary

from numpy.typing import ArrayLike

from certifier.errors import CirisError
from ciris.answers import (
    Contained,
    Containment,
    Cover,
    Coverage,
    Event,
    Graph,
    Map,
    Motion,
    Near,
    Nearest,
    Obstacle,
    Plan,
    Segments,
    Verification,
)
from ciris.documents import Document, document, given, named
from ciris.free_set import FreeSet
from ciris.job import JobData, why_no_region
from ciris.options import (
    CERTIFY,
    COVER,
    JOB,
    MAP,
    RECERTIFY,
    CertifyOptions,
    CoverOptions,
    GrowOptions,
    JobOptions,
    MapOptions,
    RecertifyOptions,
)
from ciris.reading import read
from ciris.region import RegionData, region_fields
from ciris.requests import FramePose, Tolerance, asked_for, grow_request, motion_request, plain, points, straight
from ciris.scene import Scene, scene_name
from ciris.space import Straight, numbers
from ciris.synchronous.client import Client


@dataclass(frozen=True, eq=False, repr=False)
class Region(RegionData):
    """A certified region of the service."""

    _client: Client = field(kw_only=True)

    def proof(self) -> bytes:
        """Returns the proof file, which ``ciris verify`` checks on any machine."""
        return self._client.proof(self.id)

    def verify(self) -> Verification:
        """Makes the service check the stored proof again."""
        return read(Verification, self._client.verify(self.id))

    def export(self, format: Literal["json", "npz", "drake-yaml"], name: str | None = None) -> bytes:
        """Returns the region as the bytes of a file, in which it has this name, or else its id."""
        return self._client.export(self.id, format, name)


@dataclass(frozen=True, eq=False, repr=False)
class Job(JobData):
    """A job of the service. It stays as it was; :meth:`refresh` and :meth:`wait` return it as it is later."""

    _service: Service = field(kw_only=True)

    def refresh(self) -> Job:
        """Returns the job as it is now."""
        return self._service.job(self.id)

    def follow(self) -> Iterator[Event]:
        """Yields what happens, from the job's first event on, until the job has ended.

        Raises:
            CirisError: ``unreachable`` where the service does not answer for half a minute. The job goes on, and can be followed again.
        """
        for event in self._service.client.events(self.id):
            yield read(Event, event)

    def wait(self) -> Job:
        """Waits until the job has ended, and returns it; :meth:`follow` says what it may raise."""
        for _ in self.follow():
            pass
        return self._service._job(self._service.client.job_after_all(self.id))

    def result(self) -> Region:
        """Waits until the job has ended, and returns its last certified region.

        Raises:
            CirisError: why there is none.
        """
        document = self._service.client.job_after_all(self.wait().id)
        if document["region"] is None:
            raise why_no_region(document)
        return self._service.region(document["region"])

    def obstacles(self) -> tuple[Obstacle, ...]:
        """Returns what holds the job's region back, or has cut it, worst first."""
        return tuple(read(Obstacle, one) for one in self._service.client.obstacles(self.id))

    def motion(self, prove: bool = False) -> Motion:
        """Waits until a job of the kind ``certify-path`` has ended, and returns what has become of its motion.

        Args:
            prove: whether to return the proof file as well.

        Raises:
            CirisError: why there is no verdict.
        """
        client, job = self._service.client, self.wait()
        if job.error:
            raise CirisError.from_document(job.error)
        document = client.motion(self.id)
        proof = client.motion_proof(self.id) if prove and document["proof"] else None
        return read(Motion, {**document, "proof": proof})

    def cancel(self) -> Job:
        """Asks the job to end; regions that it has certified remain."""
        self._service.client.cancel(self.id)
        return self.refresh()

    def retry(self) -> Job:
        """Creates a new job like this one, which failed or was cancelled, and returns it."""
        return self._service.job((self._service.client.retry(self.id))["id"])


class Service:
    """The ciris service. :func:`ciris.connect` finds it.

    A scene is named by its name, its id or a :class:`ciris.Scene`; ``NAME@staged`` is the staged version of a name.
    Joint positions q are (n,) or, where several may be asked about, (k, n).
    Every method may raise CirisError: what the service said, with the field that is meant, or ``unreachable``.

    Attributes:
        client: the same service, with its answers as the API's documents.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self._known: WeakValueDictionary[str, Region] = WeakValueDictionary()

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.client,)

    def __repr__(self) -> str:
        return f"Service({self.client.url!r})"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self.client.close()

    def add_scene(self, path: str | Path) -> Scene:
        """Uploads a scene file with everything it refers to. It needs PyYAML and python-flint, which ``ciris[client]`` installs."""
        return Scene.of(self.client.add_scene(path))

    def stage_scene(self, name: str, path: str | Path) -> Scene:
        """Uploads a scene file as the next version of a name. ``NAME@staged`` means it, and the name means what it did."""
        return Scene.of(self.client.stage_scene(name, path))

    def constrain_scene(self, scene: str | Scene, conditions: Sequence[Mapping[str, Any]], *, name: str) -> Scene:
        """Makes another scene out of one: the same, with more conditions. Everything that is asked of it keeps them.

        Args:
            conditions: each as in a scene file, such as ``{"name": "upright", "cone": {"body": "arm/hand", ...}}``.
            name: of the new scene. From now on it means this scene, also where it meant another one.
        """
        return Scene.of(self.client.constrain_scene(scene_name(scene), document(list(conditions)), name))

    def promote_scene(self, name: str, *, without_regions: bool = False) -> Scene:
        """Makes a name mean its staged scene, once the service has compared all of that scene's regions, and returns the scene.

        Args:
            without_regions: whether the scene may have no regions where the present one has some.
        """
        self.graph(f"{name}@staged")
        return self.scene((self.client.promote_scene(name, without_regions))["scene"])

    def scenes(self) -> list[Scene]:
        """Returns every scene, newest first."""
        return [self.scene(document["id"]) for document in self.client.scenes()]

    def scene(self, name: str) -> Scene:
        """Returns a scene by its name or id."""
        return Scene.of(self.client.scene(name), name)

    def warnings(self, scene: str | Scene) -> list[str]:
        """Returns what to know about a scene before trusting a certificate for it, in sentences."""
        found: list[str] = (self.client.lint(scene_name(scene)))["warnings"]
        return found

    def grow(self, scene: str | Scene, q: ArrayLike, **options: Unpack[GrowOptions]) -> Region:
        """Grows a certified region around q, (n,), and waits for it. The job goes on if the wait is interrupted.

        Raises:
            CirisError: why there is no region, such as ``seed_in_collision``.
        """
        job = self.submit_grow(scene, q, **options)
        return job.result()

    def submit_grow(self, scene: str | Scene, q: ArrayLike, **options: Unpack[GrowOptions]) -> Job:
        """Creates a job that grows a certified region around q, (n,), and returns it at once."""
        return self._job((self.client.create_job(grow_request(scene_name(scene), q, options)))[0])

    def cover(self, scene: str | Scene, **options: Unpack[CoverOptions]) -> Cover:
        """Grows regions until they cover a scene or connect configurations, and waits for it. The job goes on if the wait is interrupted.

        Raises:
            CirisError: what was refused, or ``not_covered`` if there is no region in the end.
        """
        job = self.submit_cover(scene, **options).wait()
        found = read(Cover, self.client.cover(job.id))
        if not found.regions and job.error:
            raise CirisError.from_document(job.error)
        return found

    def submit_cover(self, scene: str | Scene, **options: Unpack[CoverOptions]) -> Job:
        """Creates a job that covers a scene, and returns it at once. Its regions are there as soon as each is certified."""
        request = {"kind": "cover", "scene": scene_name(scene), **asked_for(options, COVER)}
        return self._job((self.client.create_job(request))[0])

    def map(self, scene: str | Scene, *, former: str | Job | None = None, **options: Unpack[MapOptions]) -> Map:
        """Proves as much as possible of the free configurations of a scene, and waits for it. The job goes on if the wait is interrupted.

        Args:
            former: a job that has grown a map. What it proves of the same bodies is taken over. By default it is the one that proves most
                about the scene's pairs; with ``"none"``, nothing is taken over.

        Raises:
            CirisError: what was refused, or what went wrong.
        """
        return self.map_of(self.submit_map(scene, former=former, **options).wait())

    def submit_map(self, scene: str | Scene, *, former: str | Job | None = None, **options: Unpack[MapOptions]) -> Job:
        """Creates a job that grows the map of a scene, and returns it at once.

        Args:
            former: as for :meth:`map`.
        """
        before = former if former is None or isinstance(former, str) else former.id
        request = {"kind": "map", "scene": scene_name(scene), **asked_for(options, MAP), **given(former=before)}
        return self._job((self.client.create_job(request))[0])

    def map_of(self, job: str | Job) -> Map:
        """Returns how far the map of a job is.

        Raises:
            CirisError: map_not_found, for a job of another kind; what went wrong, for one that has failed without a map.
        """
        found = self.job(job) if isinstance(job, str) else job
        told = read(Map, self.client.map(found.id))
        if told.stored is None and found.error:
            raise CirisError.from_document(found.error)
        return told

    def map_proof(self, job: str | Job) -> bytes:
        """Returns the proof file of the map of a job, which ``ciris verify`` checks on any machine.

        Raises:
            CirisError: map_not_found.
        """
        return self.client.map_proof(job if isinstance(job, str) else job.id)

    def free_set(self, job: str | Job) -> FreeSet:
        """Returns the free set of the map of a job. It answers without the service. It needs numba: pip install 'ciris[monitor]'.

        Raises:
            CirisError: map_not_found; proof_not_found, where no configuration is proved to be free; as FreeSet.load.
        """
        name = job if isinstance(job, str) else job.id
        return FreeSet.of_bytes(self.client.free_set(name), f"the free set of the job {name}")

    def recertify(self, region: str | Region, scene: str | Scene, **options: Unpack[RecertifyOptions]) -> Region:
        """Makes a region of a changed scene from one of the scene before, and waits for it.

        Raises:
            CirisError: ``revoked``, where nothing is left of it; ``other_robot``.
        """
        job = self.submit_recertify(region, scene, **options)
        return job.result()

    def submit_recertify(self, region: str | Region, scene: str | Scene, **options: Unpack[RecertifyOptions]) -> Job:
        """Creates a job that makes a region of a changed scene from one of the scene before, and returns it at once."""
        old = named(region.id if isinstance(region, Region) else region, "region", "its id or a region")
        request = {"kind": "recertify", "scene": scene_name(scene), "region": old, **asked_for(options, RECERTIFY)}
        return self._job((self.client.create_job(request))[0])

    def submit_certify(self, scene: str | Scene, C: ArrayLike, d: ArrayLike, **options: Unpack[CertifyOptions]) -> Job:
        """Creates a job that certifies the polytope {s : C s <= d} within the joint limits, C (m, n), d (m,), and returns it at once."""
        polytope = {"C": numbers(C, "C").tolist(), "d": numbers(d, "d").tolist()}
        request = {"kind": "certify", "scene": scene_name(scene), "polytope": polytope, **asked_for(options, CERTIFY)}
        return self._job((self.client.create_job(request))[0])

    def job(self, job_id: str) -> Job:
        """Returns a job as it is now; the first characters of its id are enough."""
        return self._job(self.client.job(job_id))

    def jobs(
        self,
        scene: str | Scene | None = None,
        *,
        state: str | None = None,
        labels: Mapping[str, str] | None = None,
        search: str | None = None,
        most: int = 50,
    ) -> list[Job]:
        """Returns the newest jobs, at most ``most``: of one scene, in one state, with labels, or that mention a text."""
        named = None if scene is None else scene_name(scene)
        found = self.client.jobs(scene=named, state=state, labels=labels, search=search, most=most)
        return [self._job(document) for document in found]

    def regions(self, scene: str | Scene | None = None) -> list[Region]:
        """Returns every region of a scene, or of all scenes, newest first. Those that you still have are not fetched again."""
        named = None if scene is None else scene_name(scene)
        listed = [document["id"] for document in self.client.regions(scene=named)]
        return [self._known.get(name) or self.region(name) for name in listed]

    def region(self, region_id: str) -> Region:
        """Returns a region; the first characters of its id are enough."""
        region = Region(**region_fields(self.client.region(region_id)), _client=self.client)
        self._known[region.id] = region
        return region

    def contains(self, scene: str | Scene, q: ArrayLike | None = None, *, s: ArrayLike | None = None) -> Containment:
        """Returns which regions of a scene contain each point, given as q, by names of configurations, or as s, (n,) or (k, n)."""
        answer = self.client.contains(scene_name(scene), **points(2, q=q, s=s))
        return Containment([read(Contained, point) for point in answer["points"]], answer["version"], answer["regions"])

    def nearest(self, scene: str | Scene, q: ArrayLike | None = None, *, s: ArrayLike | None = None) -> Nearest:
        """Returns the nearest point that a region or the latest map of a scene proves free. Points are given as for :meth:`contains`."""
        answer = self.client.nearest(scene_name(scene), **points(2, q=q, s=s))
        found = [point["nearest"] and read(Near, point | point["nearest"]) for point in answer["points"]]
        return Nearest(found, answer["version"], answer["regions"])

    def segments(
        self, scene: str | Scene, q: ArrayLike | None = None, *, s: ArrayLike | None = None, space: Straight | None = None
    ) -> Segments:
        """Returns whether each motion from one point to another is in certified regions: the edges of a roadmap, asked about together.

        Args:
            q: (2, n) or (k, 2, n), begin and end of each motion, or else ``s``.
            space: in which the motion is straight; default: in which it is given.
        """
        answer = self.client.segments(scene_name(scene), **points(3, q=q, s=s), space=straight(space, s))
        return Segments([read(Coverage, motion) for motion in answer["segments"]], answer["version"], answer["regions"])

    def path(
        self,
        scene: str | Scene,
        q: ArrayLike | None = None,
        *,
        s: ArrayLike | None = None,
        bezier: ArrayLike | None = None,
        knots: ArrayLike | None = None,
        control_points: ArrayLike | None = None,
        space: Straight | None = None,
        times: ArrayLike | None = None,
    ) -> Coverage:
        """Returns whether every point of a path is in certified regions, which is proved, and in which.

        The path is given as to :meth:`certify_path`.

        Args:
            times: (k,) when the path is at each waypoint, or (P + 1,) when the pieces of ``bezier`` begin and end; the answer is in these.
                Default: 0, 1, 2 ... A B-spline has its knots instead.
        """
        asked = motion_request(scene_name(scene), q=q, s=s, bezier=bezier, knots=knots, control_points=control_points, space=space)
        return read(Coverage, self.client.path({**asked, **given(times=plain(times, "times"))}))

    def plan(
        self,
        scene: str | Scene,
        start: ArrayLike | str,
        goal: ArrayLike | str | None = None,
        *,
        goals: ArrayLike | None = None,
        pose: FramePose | None = None,
        line: Tolerance | None = None,
        via: ArrayLike | None = None,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        regions_only: bool = False,
        seconds: float | None = None,
        prove: bool = False,
    ) -> Plan:
        """Finds a motion from rest to rest that is proved to be free of collision, or says why there is none.

        Args:
            start, goal: joint positions (n,), or names of configurations; or the id of a region, for any point of it.
            goals: (k, n) instead of ``goal``; the motion ends in the one to which it is shortest.
            pose: instead of ``goal``, where a frame ends: ``{"frame": ..., "position": (3,) metres, "rpy": (3,) radians}``.
            line: the frame goes to the pose on a straight line, within ``{"metres": ..., "radians": ...}`` of it.
            via: (m, n) configurations to go through, in this order.
            speed, acceleration: limits in rad/s and rad/s² (or m), one for all joints or one for each; default: those of the service.
            regions_only: whether the motion has to lie in certified regions.
            seconds: how long to search; default: that of the service.
            prove: whether to fetch the proof file about the motion.
        """
        asked: Document = {
            "scene": scene_name(scene),
            "start": plain(start, "start"),
            **given(goal=plain(goal, "goal"), goals=plain(goals, "goals"), via=plain(via, "via"), seconds=seconds),
            **given(pose=document(pose) if pose is not None else None, line=line),
            **given(speed=plain(speed, "speed"), acceleration=plain(acceleration, "acceleration")),
            "regions_only": regions_only,
            "prove": prove,
        }
        while True:
            answer = self.client.plan(asked)
            if answer["complete"] or answer["reason"] != "disconnected":
                return read(Plan, {**answer, "proof": answer["proof"] and base64.b64decode(answer["proof"])})

    def certify_path(
        self,
        scene: str | Scene,
        q: ArrayLike | None = None,
        *,
        s: ArrayLike | None = None,
        bezier: ArrayLike | None = None,
        knots: ArrayLike | None = None,
        control_points: ArrayLike | None = None,
        space: Straight | None = None,
        tube: bool = False,
        padding: float = 0.0,
        clearance: bool = False,
        prove: bool = False,
    ) -> Motion:
        """Certifies a motion itself, without any region, or finds its first contact.

        Args:
            q: (k, n), the waypoints, or else ``s``, or a curve of a degree m from 1 to 15.
            bezier: (P, m + 1, n), the control points of polynomial pieces, or (m + 1, n) of one. A piece begins where the one before ends.
            knots: (k + m + 1,), those of a B-spline; ``control_points`` come with it.
            control_points: (k, n), those of the B-spline.
            space: in which the motion is straight between waypoints; default: in which they are given. For a curve, which coordinates its
                control points are; default: q.
            tube: whether to look for the largest certified tube about the motion.
            padding: metres that are added around every body, beyond the scene's padding: the motion is certified with the bodies of each
                pair twice this apart.
            clearance: whether to prove nearly the least distance of the bodies.
            prove: whether to return the proof file as well.
        """
        asked = motion_request(scene_name(scene), q=q, s=s, bezier=bezier, knots=knots, control_points=control_points, space=space)
        options = {"tube": tube, "padding": float(padding), "clearance": clearance, "prove": prove}
        document = self.client.certify_path({**asked, **options})
        proof = document["proof"] and base64.b64decode(document["proof"])
        return read(Motion, {**document, "proof": proof})

    def submit_certify_path(
        self,
        scene: str | Scene,
        q: ArrayLike | None = None,
        *,
        s: ArrayLike | None = None,
        bezier: ArrayLike | None = None,
        knots: ArrayLike | None = None,
        control_points: ArrayLike | None = None,
        space: Straight | None = None,
        tube: bool = False,
        padding: float = 0.0,
        clearance: bool = False,
        **options: Unpack[JobOptions],
    ) -> Job:
        """Creates a job that certifies a motion which may take minutes, and returns it at once; its :meth:`Job.motion` waits.

        The arguments are as of :meth:`certify_path`.
        """
        asked = motion_request(scene_name(scene), q=q, s=s, bezier=bezier, knots=knots, control_points=control_points, space=space)
        motion = {**asked, "tube": tube, "padding": float(padding), "clearance": clearance}
        job, _ = self.client.create_job({"kind": "certify-path", **motion, **asked_for(options, JOB)})
        return self._job(job)

    def graph(self, scene: str | Scene) -> Graph:
        """Returns which regions of a scene overlap, once the service has compared them all."""
        while True:
            answer = self.client.graph(scene_name(scene))
            if answer["complete"]:
                return read(Graph, answer)

    def _job(self, document: Document) -> Job:
        fields = read(JobData, {**document, "region_id": document["region"]})
        return Job(**vars(fields), _service=self)
