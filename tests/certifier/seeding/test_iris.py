"""IRIS: contacts are contacts and no nearer ones are near, faces keep the points, and the polytope keeps its promise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks import catalogue
from certifier.model import WORLD, Joint, JointKind, Pair, Scene
from certifier.outcome import Guarantee
from certifier.pair.collisions import in_collision
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume, volume_in_q
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.proved import needed_faces
from certifier.seeding import iris as iris_module
from certifier.seeding.contacts import CLOSE, Contacts
from certifier.seeding.iris import _face, iris
from certifier.seeding.options import SeedOptions
from certifier.seeding.trim import Trim
from tests.certifier.scenes import ball, box, planar_arm
from tests.certifier.seeding.posts import collisions, posts


def hook(s):
    return np.array([s[0] + np.cos(2 * np.arctan(s[1])), np.sin(2 * np.arctan(s[1]))])


@pytest.mark.parametrize("shape", [np.eye(2), np.diag([1.0, 0.2]), np.array([[0.5, 0.3], [0.3, 0.7]])])
def test_contacts_are_where_bodies_touch_and_as_near_as_a_nonlinear_program_finds(shape):
    """Trigonometry is the oracle for the contact, and SciPy's SLSQP from many starts for the nearest one."""
    scene, center, inverse = posts(1), np.zeros(2), np.linalg.inv(shape)
    post = scene.geometry("post0").vertices[0][:2]
    samples = np.random.default_rng(0).uniform(scene.s_lower, scene.s_upper, (20_000, 2))
    colliding = samples[[np.linalg.norm(hook(s) - post) < 0.2 for s in samples]]
    near, far = Contacts(scene).nearest(colliding, center, shape)
    assert len(near) == len(colliding) > 20
    gaps = np.array([np.linalg.norm(hook(s) - post) - 0.2 for s in near])
    assert (gaps <= CLOSE + 1e-9).all()
    assert (gaps >= -1e-3).all()
    assert np.allclose(far, np.linalg.norm(near @ inverse, axis=1))
    constraint = {"type": "ineq", "fun": lambda s: 0.2 - np.linalg.norm(hook(s) - post)}
    found = [minimize(lambda s: ((inverse @ s) ** 2).sum(), s, constraints=[constraint], method="SLSQP") for s in colliding[::5]]
    nearest = min(np.sqrt(one.fun) for one in found if one.success)
    assert far.min() == pytest.approx(nearest, rel=0.02)


def test_from_free_points_there_is_no_contact_and_no_pair():
    scene = posts(7)
    contacts, free = Contacts(scene), np.zeros((5, 2))
    assert contacts.free(free).all()
    assert contacts.touching(free) == {}
    near, far = contacts.nearest(free, np.zeros(2), np.eye(2))
    assert len(near) == len(far) == 0


def test_what_touches_is_what_drake_says():
    scene = catalogue.scene("iiwa_shelf")
    s = np.random.default_rng(0).uniform(scene.s_lower, scene.s_upper, (500, scene.n))
    contacts = Contacts(scene)
    touching = in_collision(scene, s)
    assert (contacts.free(s) == ~touching).all()
    found = contacts.touching(s)
    assert sum(map(len, found.values())) == touching.sum() > 0
    for pair, points in found.items():
        assert in_collision(replace(scene, pairs=(pair,)), points).all()


@pytest.mark.parametrize("angle", np.linspace(0, 2 * np.pi, 12, endpoint=False))
def test_a_face_is_before_its_contact_and_behind_the_points(angle):
    center, contact = np.zeros(2), 1.5 * np.array([np.cos(angle), np.sin(angle)])
    points = np.array([(0.0, 0.0), (1.0, 0.9), (-0.4, 0.2)])
    inverse = np.linalg.inv(np.array([[1.0, 0.9], [0.9, 1.0]]))
    row, offset = _face(contact, center, inverse, points, 0.01)
    assert np.linalg.norm(row) == pytest.approx(1)
    assert (points @ row < offset).all()
    assert contact @ row > offset


def test_no_face_parts_a_contact_in_the_hull_of_the_points():
    points = np.array([(-1.0, 0.0), (1.0, 0.0)])
    assert _face(np.array([0.5, 0.0]), np.zeros(2), np.eye(2), points, 0.01) is None
    row, offset = _face(np.array([0.5, 1e-3]), np.zeros(2), np.eye(2), points, 0.01)
    assert 0 < offset < row @ (0.5, 1e-3)


@pytest.mark.parametrize("count", [1, 3, 7])
@pytest.mark.parametrize("random_seed", [0, 1])
def test_iris_keeps_its_promise_and_the_seed(count, random_seed):
    """Trigonometry is the oracle: at most epsilon of the volume in q collides, and the region is not small."""
    scene, seed = posts(count), np.zeros((1, 2))
    C, d, account = iris(scene, seed, SeedOptions(random_seed=random_seed))
    left, large = collisions(scene, C, d)
    assert account["guarantee"] == Guarantee.SAMPLED
    assert account["warnings"] == []
    assert left <= 0.001
    assert large > {1: 8.0, 3: 4.0, 7: 1.5}[count]
    assert (d > C @ seed[0]).all()
    assert np.allclose(np.linalg.norm(C, axis=1), 1)
    again = iris(scene, seed, SeedOptions(random_seed=random_seed))
    assert np.array_equal(C, again[0])
    assert np.array_equal(d, again[1])


def trimmed(scene, polytope, points, options):
    trim = Trim(scene, polytope, points, options, np.random.default_rng(0))
    trim.by_samples(0.0)
    trim.by_descents()
    return trim


def test_one_round_of_faces_does_not_pass():
    """The twin that does not pass: what a round cuts off is not looked at again. With more rounds, the same polytope passes."""
    scene, seed = posts(1), np.zeros((1, 2))
    for rounds, passes in ((1, False), (20, True)):
        options = SeedOptions(max_iterations_separating_planes=rounds)
        trim = trimmed(scene, scene.polytope([], []), seed, options)
        assert trim.passed is passes
        assert (trim.polytope.d[:, None] > trim.polytope.C @ seed.T).all()
        assert len(trim.polytope.d) > 2 * scene.n


def test_a_scene_without_pairs_keeps_all_of_the_joint_limits():
    C, d, account = iris(replace(posts(1), pairs=()), np.zeros((1, 2)), SeedOptions())
    assert C.shape == (0, 2)
    assert d.shape == (0,)
    assert account["guarantee"] == Guarantee.SAMPLED


@pytest.mark.parametrize("name", ["ur3e_bin", "iiwa_shelf"])
def test_a_proposal_for_an_arm_is_large_and_nearly_free(name):
    """Drake's collision checker is the oracle for samples of its own; IrisNp2 proposes 5500 and 8900 at most (docs/trials.md)."""
    scene = catalogue.scene(name)
    seed = scene.to_s(catalogue.seed(name))[None]
    C, d, _ = iris(scene, seed, SeedOptions())
    polytope = scene.polytope(C, d)
    samples = uniform_in_q(polytope, scene, 200, 20, 9).reshape(-1, scene.n)
    assert in_collision(scene, samples).mean() <= 0.002
    assert volume_in_q(polytope, scene, volume(polytope, 0), 0)[0] > 5000


def test_what_may_collide_is_not_called_sampled(monkeypatch):
    monkeypatch.setattr(Trim, "by_samples", lambda trim, _: inscribed_ellipsoid(trim.polytope))
    monkeypatch.setattr(Trim, "by_descents", lambda _: None)
    account = iris(posts(1), np.zeros((1, 2)), SeedOptions())[2]
    assert account["guarantee"] == Guarantee.NONE
    assert account["warnings"] == ["more than 0.001 of the polytope may collide: too many faces would be needed"]


def test_a_contact_beside_the_seed_is_cut_off_although_it_is_next_to_nothing_of_the_polytope():
    axes = np.eye(3)[:2]
    bodies = (WORLD, "cart/x", "cart/y")
    joints = tuple(
        Joint(f"{bodies[i + 1]}/slide", JointKind.PRISMATIC, bodies[i], bodies[i + 1], axis, np.eye(4), np.eye(4), i, -1.0, 1.0)
        for i, axis in enumerate(axes)
    )
    near = np.array([0.05, 0.0])
    balls = ball("cart", "cart/y", 0.005), ball("post", WORLD, 0.005, (*near, 0.0))
    scene = Scene("cart", joints, bodies, balls, (Pair("cart", "post"),), (), np.zeros(2))
    whole, seed = scene.polytope([], []), np.zeros((1, 2))
    samples = uniform_in_q(whole, scene, 1000, 20, 0).reshape(-1, 2)
    assert 0 < in_collision(scene, samples).mean() < 0.0005  # so few that a test of the whole polytope takes no notice
    trim = trimmed(scene, whole, seed, SeedOptions(q=(0.0, 0.0)))
    assert trim.passed
    found = trim.polytope
    assert found.contains(seed).all()
    ring = near + 0.0099 * np.array([[np.cos(t), np.sin(t)] for t in np.linspace(0, 2 * np.pi, 64)])
    assert whole.contains(ring).all()
    assert found.contains(ring).mean() < 0.2
    assert not found.contains(near[None])[0]
    assert volume(found, 0)[0] > 1.5


@pytest.mark.parametrize(("first", "kept", "tries", "chosen"), [(1e-3, 0.3, 2, 1), (1e3, 0.3, 2, 0), (1e-3, 0.7, 1, 0)])
def test_a_sliver_is_tried_again_and_the_larger_one_stays(monkeypatch, first, kept, tries, chosen):
    """What random numbers lead to depends on the processor. So the first try is said to be a sliver, or not."""
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 0.9, 0.0)))
    points, found = np.zeros((1, 2)), []
    real = iris_module._found

    def told(*args):
        this = real(*args)
        if not found:
            this = replace(this, kept=kept, volume=first * this.volume)
        found.append(this)
        return this

    monkeypatch.setattr(iris_module, "_found", told)
    C, d, _ = iris(scene, points, SeedOptions(q=(0.0, 0.0)))
    assert len(found) == tries
    polytope = found[chosen].trim.polytope
    expected = needed_faces(scene, polytope.C[: -2 * scene.n], polytope.d[: -2 * scene.n], points)
    np.testing.assert_array_equal(C, expected[0])
    np.testing.assert_array_equal(d, expected[1])


def test_a_try_that_cannot_be_larger_ends_at_once():
    scene = posts(3)
    points, options = np.zeros((1, 2)), SeedOptions(q=(0.0, 0.0))
    whole = iris_module._found(scene, points, options, np.random.default_rng(0), 0.0)
    assert whole is not None
    again = iris_module._found(scene, points, options, np.random.default_rng(0), 0.999 * whole.volume)
    assert again is not None
    assert again.volume == whole.volume
    assert iris_module._found(scene, points, options, np.random.default_rng(0), 1.001 * whole.volume) is None
