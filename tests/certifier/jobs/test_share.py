"""The share of a proposal against closed forms in q, and the manifest of a grown region that states it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import linprog

from certifier.growth.options import GrowthOptions
from certifier.growth.paper.options import PaperOptions
from certifier.jobs import share as module
from certifier.jobs.local import grow
from certifier.jobs.share import CHAINS, EACH, SampledProposal
from certifier.model import WORLD, JointKind, Polytope
from certifier.polytopes.sampling import hit_and_run
from tests.certifier.scenes import ball, box, planar_arm
from tests.scenes import slider

FAR = ball("world/far", WORLD, 0.1, (9.0, 9.0, 0.0))
ONE, TWO = planar_arm(1, FAR), planar_arm(2, FAR)
WHOLE = {scene.n: SampledProposal.of(scene, scene.polytope([], [])) for scene in (ONE, TWO)}


def near(found, exact):
    """Whether a share is within five of its standard errors, many cuts of the same samples being tried."""
    return abs(found["value"] - exact) <= 5 * found["stderr"]


def test_samples_that_are_uniform_in_s_would_not_pass():
    s = hit_and_run(ONE.polytope([], []), np.zeros(1), CHAINS * EACH, seed=0).reshape(CHAINS, EACH, 1)
    wrong = replace(WHOLE[1], s=s)
    assert not near(wrong.share(ONE.polytope([[1.0]], [np.tan(0.5)])), 0.75)


def test_all_of_a_proposal_is_kept_by_itself_and_by_what_is_larger():
    proposal = TWO.polytope([[1.0, 0.5]], [0.2])
    sampled = SampledProposal.of(TWO, proposal)
    one_sample = 1 / sampled.free.size
    for region in (proposal, TWO.polytope([], [])):
        assert sampled.share(region) == {"value": 1.0, "stderr": one_sample, "collision_free": 1.0, "samples": sampled.free.size}
    outside = sampled.share(TWO.polytope([[-1.0, -0.5]], [-0.3]))
    assert (outside["value"], outside["stderr"]) == (0.0, one_sample)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", np.linspace(-1.8, 1.8, 10))
def test_a_cut_of_one_joint_leaves_its_part_of_the_angle(angle, sign):
    region = ONE.polytope([[sign]], [sign * np.tan(angle / 2)])
    assert near(WHOLE[1].share(region), 0.5 + sign * angle / 4)


@pytest.mark.parametrize("offset", [-0.7, -0.2, 0.0, 0.4, 1.1])
@pytest.mark.parametrize("direction", np.linspace(0.1, 6.1, 9))
def test_a_cut_of_two_joints_leaves_the_area_below_its_curve_in_q(offset, direction):
    """Along q_1 the half-space c's <= offset leaves an interval of q_2 whose end is known."""
    c = np.array([np.cos(direction), np.sin(direction)])

    def part(q1):
        rest = (offset - c[0] * np.tan(q1 / 2)) / c[1]
        end = np.clip(2 * np.arctan(rest), -2.0, 2.0)
        return (end + 2.0 if c[1] > 0 else 2.0 - end) / 4

    exact = quad(part, -2.0, 2.0, limit=200, epsabs=1e-6)[0] / 4
    assert near(WHOLE[2].share(TWO.polytope([c], [offset])), exact)


def test_a_cut_in_the_middle_leaves_half_whatever_its_direction():
    for direction in np.linspace(0, np.pi, 13):
        assert near(WHOLE[2].share(TWO.polytope([[np.cos(direction), np.sin(direction)]], [0.0])), 0.5)


def test_prismatic_joints_count_in_metres():
    scene = planar_arm(2, FAR, kind=JointKind.PRISMATIC)
    sampled = SampledProposal.of(scene, scene.polytope([], []))
    assert near(sampled.share(scene.polytope([[1.0, 0.0]], [1.0])), 0.75)
    assert near(sampled.share(scene.polytope([[1.0, 1.0]], [2.0])), 0.875)


def test_only_the_free_part_of_the_proposal_counts():
    """The slider's ball collides for |x| <= 0.2 and is free on 0.2 < |x| <= 1; a region of [0.3, 0.7] keeps a quarter of that."""
    scene = slider()
    ground = replace(scene.geometries[1], vertices=np.zeros((1, 3)))
    blocked = replace(scene, geometries=(scene.geometries[0], ground))
    sampled = SampledProposal.of(blocked, blocked.polytope([], []))
    found = sampled.share(blocked.polytope([[1.0], [-1.0]], [0.7, -0.3]))
    assert near(found, 0.25)
    assert found["collision_free"] == pytest.approx(0.8, abs=0.02)
    hopeless = SampledProposal.of(blocked, blocked.polytope([[1.0], [-1.0]], [0.1, 0.1]))
    found = hopeless.share(blocked.polytope([], []))
    assert (found["value"], found["stderr"], found["collision_free"]) == (None, None, 0.0)


def test_the_standard_error_is_as_large_as_the_errors_are(monkeypatch):
    """Half of a thin diagonal polytope, where samples of one chain depend on each other, for many seeds: errors over standard errors."""
    thin = TWO.polytope([[1.0, -1.0], [-1.0, 1.0]], [0.15, 0.15])
    ratios = []
    for seed in range(60):
        monkeypatch.setattr(module, "_SEED", seed)
        found = SampledProposal.of(TWO, thin).share(TWO.polytope([[1.0, 1.0]], [0.0]))
        ratios.append((found["value"] - 0.5) / found["stderr"])
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.3
    independent = 0.5 / np.sqrt(found["samples"])
    assert found["stderr"] > 2 * independent


@pytest.mark.parametrize("kind", [JointKind.REVOLUTE, JointKind.PRISMATIC])
def test_a_grown_regions_manifest_tells_the_share_the_proposal_and_the_ranges(kind):
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (1.2, 0.8, 0.0)), limit=1.0, kind=kind)
    if kind is JointKind.PRISMATIC:
        scene = replace(scene, joints=tuple(replace(joint, axis=np.array([0.0, 1.0, 0.0])) for joint in scene.joints))
    seed = {"q": [0.0, -0.2], "method": "box", "half_width": 0.5}
    options = GrowthOptions(seed=seed, paper=PaperOptions(max_rounds=0, pushes=1))
    manifest = grow(scene, options).manifest
    proposal = Polytope(*(np.array(manifest["provenance"]["proposal"][name]) for name in ("halfspace_normals", "halfspace_offsets")))
    region = Polytope(*(np.array(manifest[name]) for name in ("halfspace_normals", "halfspace_offsets")))
    assert proposal.contains(scene.to_s([[0.0, -0.2], [0.45, 0.2]])).all()
    assert not proposal.contains(scene.to_s([[0.0, 0.9], [1.1, 0.0]])).any()

    q = np.random.default_rng(0).uniform(-1, 1, (40_000, 2))
    s = scene.to_s(q)
    proposed = proposal.contains(s)
    free = proposed & ~module.in_collision(scene, s)
    found = manifest["share"]
    assert found["collision_free"] == pytest.approx(free.sum() / proposed.sum(), abs=0.02)
    assert 0.3 < found["value"] == pytest.approx((free & region.contains(s)).sum() / free.sum(), abs=5 * found["stderr"])
    assert manifest["provenance"]["growth_curve"][-1]["share"] == found["value"]

    unit, scale = ("deg", np.rad2deg(1.0)) if kind is JointKind.REVOLUTE else ("m", 1.0)
    assert list(manifest["joint_ranges"]) == ["arm/joint1", "arm/joint2"]
    if kind is JointKind.REVOLUTE:
        narrowest = min(known["upper"] - known["lower"] for known in manifest["joint_ranges"].values())
        assert 0 < manifest["q_volume"]["least_width"] <= narrowest + 1e-9
    else:
        assert manifest["q_volume"]["least_width"] is None
    for i, known in enumerate(manifest["joint_ranges"].values()):
        ends = [sign * linprog(sign * np.eye(2)[i], region.C, region.d, bounds=(None, None)).fun for sign in (1, -1)]
        in_q = [scale * scene.to_q(np.full(2, end))[i] for end in ends]
        assert [known["lower"], known["upper"], known["unit"]] == [*map(pytest.approx, in_q), unit]
        line = np.tile(scene.to_s(manifest["seed"]), (20_001, 1))
        line[:, i] = np.linspace(scene.s_lower[i], scene.s_upper[i], len(line))
        inside = scale * scene.to_q(line[region.contains(line)])[:, i]
        assert known["through_seed"] == pytest.approx([inside.min(), inside.max()], abs=0.02 * scale)
