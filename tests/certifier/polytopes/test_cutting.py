"""Faces that cut off what cannot be certified: they do cut it off, keep what has to stay, and lose little."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.model import JointKind
from certifier.polytopes import cutting
from certifier.polytopes.cutting import BARELY, cut
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.polytopes.gibbs import uniform_in_q
from tests.certifier.scenes import planar_arm

ALL = (0, 1, 2)


def polytope_of(scene, rng, faces=6):
    """A random polytope about 0 within the joint limits."""
    C = rng.normal(size=(faces, scene.n))
    return scene.polytope(C / np.linalg.norm(C, axis=1)[:, None], rng.uniform(0.4, 1.0, faces))


def corner_of(scene, polytope, rng, joints=ALL, count=12):
    """Points of the polytope near one far from 0, told apart in these joints."""
    samples = uniform_in_q(polytope, scene, 100, 10, int(rng.integers(2**31))).reshape(-1, scene.n)
    J = list(joints)
    way = rng.normal(size=len(J))
    return samples[np.argsort(samples[:, J] @ way)[-count:]]


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(JointKind)[:2]))
def test_what_has_to_go_goes_and_what_has_to_stay_stays(seed, kind):
    scene, rng = planar_arm(3, kind=kind), np.random.default_rng(seed)
    polytope = polytope_of(scene, rng)
    keep = np.concatenate([np.zeros((1, 3)), rng.uniform(-0.1, 0.1, (3, 3))])
    corners = [(joints, corner_of(scene, polytope, rng, joints, 6), 1.0) for joints in ((0, 1), ALL)]
    smaller = cut(scene, polytope, keep, corners, polytope).polytope
    assert smaller is not None
    for _, points, _ in corners:
        assert not smaller.contains(points).any()
    assert (keep @ smaller.C.T < smaller.d).all()
    # What was there is there still or has moved in, the joint limits are last as they were, and the faces between are new.
    old, limits = len(polytope.d) - 2 * scene.n, 2 * scene.n
    assert (smaller.C[:old] == polytope.C[:old]).all()
    assert (smaller.d[:old] <= polytope.d[:old]).all()
    assert (smaller.C[-limits:] == polytope.C[-limits:]).all()
    assert (smaller.d[-limits:] == polytope.d[-limits:]).all()
    assert np.linalg.norm(smaller.C[old:-limits], axis=1) == pytest.approx(1)


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(0,), (1,), (0, 2)]))
def test_a_face_lies_in_the_joints_between_the_bodies(seed, joints):
    scene, rng = planar_arm(3), np.random.default_rng(seed)
    polytope = polytope_of(scene, rng)
    smaller = cut(scene, polytope, np.zeros((1, 3)), [(joints, corner_of(scene, polytope, rng, joints, 4), 1.0)], polytope).polytope
    old = len(polytope.d) - 2 * scene.n
    faces = np.concatenate([smaller.C[old : -2 * scene.n], smaller.C[:old][smaller.d[:old] < polytope.d[:old]]])
    others = [j for j in range(3) if j not in joints]
    assert len(faces)
    assert (faces[:, others] == 0).all()


def test_samples_are_drawn_once_for_many_rounds(monkeypatch):
    """Of the whole joint space, this polytope has too few samples; those of its own serve the next round too."""
    scene, rng, drawn = planar_arm(3), np.random.default_rng(0), []

    def draw(polytope, *arguments):
        drawn.append(polytope)
        return uniform_in_q(polytope, *arguments)

    monkeypatch.setattr(cutting, "uniform_in_q", draw)
    cutting.samples_of.cache.clear()
    limits, keep = scene.polytope([], []), np.zeros((1, 3))
    polytope = scene.polytope(np.concatenate([np.eye(3), -np.eye(3)]), [0.05] * 6)
    first = cut(scene, polytope, keep, [(ALL, corner_of(scene, polytope, rng), 1.0)], limits)
    assert first.around is polytope
    second = cut(scene, first.polytope, keep, [(ALL, corner_of(scene, first.polytope, rng), 1.0)], first.around)
    assert second.polytope is not first.polytope
    assert second.around is polytope
    assert [id(one) for one in drawn] == [id(limits), id(polytope)]


def test_nothing_to_cut_off_draws_no_samples(monkeypatch):
    scene = planar_arm(3)
    monkeypatch.setattr(cutting, "samples_of", None)
    polytope = scene.polytope([], [])
    made = cut(scene, polytope, np.zeros((1, 3)), [(ALL, np.empty((0, 3)), 1.0)], polytope)
    assert made.polytope is polytope
    assert [one.faces for one in made.made] == [0]


def test_contacts_along_a_face_take_no_new_face():
    scene = planar_arm(3)
    polytope = scene.polytope(np.array([[1.0, 0.5, -0.3]]) / np.linalg.norm([1.0, 0.5, -0.3]), [0.4])
    samples = uniform_in_q(polytope, scene, 1000, 40, 0).reshape(-1, 3)
    sheet = samples[np.argsort(polytope.d[0] - samples @ polytope.C[0])[:40]]
    smaller = cut(scene, polytope, np.zeros((1, 3)), [(ALL, sheet, 1.0)], polytope).polytope
    assert len(smaller.d) == len(polytope.d)
    assert smaller.d[0] < polytope.d[0]
    assert not smaller.contains(sheet).any()
    assert smaller.contains(samples).mean() > 0.95


def test_a_joint_limit_gets_a_face_of_its_own_beside_it():
    """Proofs and users know the limits by their place, so a limit itself never moves."""
    scene = planar_arm(2)
    polytope = scene.polytope([], [])
    upper = polytope.d[polytope.C[:, 0] > 0].max()
    end = np.column_stack([np.full(9, 0.999 * upper), np.linspace(-0.5, 0.5, 9)])
    smaller = cut(scene, polytope, np.zeros((1, 2)), [((0,), end, 1.0)], polytope).polytope
    assert len(smaller.d) == len(polytope.d) + 1
    assert (smaller.d[-4:] == polytope.d).all()
    assert not smaller.contains(end).any()


def test_nothing_to_cut_off_changes_nothing():
    scene = planar_arm(3)
    polytope = scene.polytope([], [])
    outside = np.full((2, 3), 100.0)
    for points in (np.zeros((0, 3)), outside):
        same = cut(scene, polytope, np.zeros((1, 3)), [(ALL, points, 1.0)], polytope).polytope
        assert same.C.tolist() == polytope.C.tolist()
        assert same.d.tolist() == polytope.d.tolist()


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(-0.9, 0.9))
def test_a_contact_on_a_face_is_cut_off_where_it_is_asked_for(seed, share):
    """A search comes to the very face that cut other contacts off. Rounding says which side the contact is on, and it is found again."""
    scene, rng = planar_arm(3), np.random.default_rng(seed)
    polytope = polytope_of(scene, rng)
    samples = uniform_in_q(polytope, scene, 20, 10, seed % 2**31).reshape(-1, 3)
    room = polytope.d[0] - samples @ polytope.C[0]
    contact = samples[np.argmin(room)] + (room.min() + share * BARELY) * polytope.C[0]

    def cut_off(point, beyond):
        return cut(scene, polytope, np.zeros((1, 3)), [(ALL, point[None], 1.0)], polytope, beyond).polytope

    if (polytope.d[1:] - polytope.C[1:] @ contact > 0).all():
        smaller = cut_off(contact, BARELY)
        assert (smaller.d - smaller.C @ contact).min() < -100 * BARELY
        if abs(share) > 0.01:
            assert (cut_off(contact, 0.0) is polytope) == (share > 0)
    assert cut_off(contact + 3 * BARELY * polytope.C[0], BARELY) is polytope


@pytest.mark.parametrize("joints", [(0,), (0, 1)])
@pytest.mark.parametrize("beyond_the_face", [0.0, 1e-9, 0.5 * BARELY])
@pytest.mark.parametrize("near", [0.0, 1e-16, 1e-9, 0.5 * BARELY, 3 * BARELY])
def test_a_contact_on_a_face_beside_a_point_to_keep_goes_for_good_or_cannot_be_cut_off(near, beyond_the_face, joints):
    """Or a face would move by next to nothing, and the contact would be found again in every round."""
    scene = planar_arm(3)
    polytope = scene.polytope(np.array([[1.0, 0.0, 0.0]]), [0.4])
    keep, contact = np.array([[0.4 - near, 0.0, 0.0]]), np.array([[0.4 + beyond_the_face, 0.0, 0.0]])
    smaller = cut(scene, polytope, keep, [(joints, contact, 1.0)], polytope, BARELY).polytope
    if near < BARELY:
        assert smaller is None
    else:
        assert (smaller.d - smaller.C @ contact[0]).min() <= -BARELY
        assert smaller.contains(keep).all()


@pytest.mark.parametrize("place", [0.0, 0.5, 0.99, 1.01])
def test_a_point_between_those_to_keep_cannot_be_cut_off(place):
    scene = planar_arm(2)
    polytope, keep = scene.polytope([], []), np.array([[0.0, 0.0], [0.2, 0.4]])
    point = keep[0] + place * (keep[1] - keep[0])
    smaller = cut(scene, polytope, keep, [((0, 1), point[None], 1.0)], polytope).polytope
    if place < 1:
        assert smaller is None
    else:
        assert not smaller.contains(point)
        assert smaller.contains(keep).all()


def test_a_point_that_differs_from_those_to_keep_in_other_joints_alone_cannot_be_cut_off():
    scene = planar_arm(2)
    polytope = scene.polytope([], [])
    point = np.array([[0.0, 0.5]])
    assert cut(scene, polytope, np.zeros((1, 2)), [((0,), point, 1.0)], polytope).polytope is None
    assert cut(scene, polytope, np.zeros((1, 2)), [((1,), point, 1.0)], polytope).polytope is not None


def test_scattered_points_get_several_faces():
    """The four corners of a square, which one face cannot cut off together without the middle."""
    scene = planar_arm(2)
    polytope = scene.polytope([], [])
    points = 0.9 * scene.s_upper * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    smaller = cut(scene, polytope, np.zeros((1, 2)), [((0, 1), points, 1.0)], polytope).polytope
    assert not smaller.contains(points).any()
    assert len(smaller.d) == len(polytope.d) + 4


def test_what_faces_came_to_is_said_corner_by_corner():
    scene = planar_arm(2)
    polytope = scene.polytope([], [])
    points = 0.9 * scene.s_upper * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    corners = [((0, 1), points, 1.0), ((0, 1), points, 1.0), ((0, 1), np.zeros((0, 2)), 1.0)]
    found = cut(scene, polytope, np.zeros((1, 2)), corners, polytope)
    first, *others = found.made
    assert first.faces == 4
    assert first.s.tolist() in points.tolist()
    samples = uniform_in_q(polytope, scene, 1000, 20, 3).reshape(-1, 2)
    gone = 1 - found.polytope.contains(samples).mean()
    assert first.lost == pytest.approx(gone, abs=0.02)
    assert [(one.faces, one.lost, one.s) for one in others] == [(0, 0, None)] * 2, "there was nothing left to cut off"


def tangent(polytope, points):
    """The face through the point of the inscribed ellipsoid's metric that is nearest to its centre, normal there: what cutting by the
    ellipsoid alone would take, moved so that all points are beyond it."""
    ellipsoid = inscribed_ellipsoid(polytope)
    metric = np.linalg.inv(ellipsoid.shape @ ellipsoid.shape.T)
    away = points - ellipsoid.center
    nearest = away[np.argmin(np.einsum("wi,ij,wj->w", away, metric, away))]
    normal = metric @ nearest
    return normal, float((points @ normal).min())


@pytest.mark.slow
def test_less_volume_is_lost_than_by_planes_tangent_to_the_inscribed_ellipsoid():
    """By volume in q over random polytopes and corners: at the mean, and at most of them."""
    scene, ours, theirs = planar_arm(3, limit=2.5), [], []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        polytope = polytope_of(scene, rng)
        points = corner_of(scene, polytope, rng, count=8)
        smaller = cut(scene, polytope, np.zeros((1, 3)), [(ALL, points, 1.0)], polytope).polytope
        samples = uniform_in_q(polytope, scene, 200, 20, 10_000 + seed).reshape(-1, 3)
        normal, offset = tangent(polytope, points)
        ours.append(1 - smaller.contains(samples).mean())
        theirs.append((samples @ normal >= offset).mean())
    ours, theirs = np.array(ours), np.array(theirs)
    assert ours.mean() < theirs.mean()
    assert (ours < theirs).mean() > 0.6


def test_a_face_that_loses_more_than_it_may_is_left_out_and_others_are_not():
    scene = planar_arm(2)
    polytope, keep = scene.polytope([], []), np.zeros((1, 2))
    middle, corner = np.array([[0.0, 0.05]]), polytope_corner(polytope)
    smaller = cut(scene, polytope, keep, [((0, 1), np.concatenate([middle, corner]), 0.1)], polytope).polytope
    assert smaller is not None
    assert smaller.contains(middle).all()
    assert not smaller.contains(corner).any()
    larger = cut(scene, polytope, keep, [((0, 1), middle, 1.0)], polytope).polytope
    assert larger is not None
    assert not larger.contains(middle).any()


def polytope_corner(polytope):
    """A point close to the corner of a box of joint limits, (1, n)."""
    n = polytope.C.shape[1]
    return 0.98 * polytope.d[-2 * n : -n][None]


def test_where_few_samples_are_left_in_a_round_others_are_drawn():
    """What has to stay is in a corner without samples, so the first face loses all of them, and the second saw none: numpy warned."""
    scene = planar_arm(3)
    polytope = scene.polytope(np.zeros((0, 3)), np.zeros(0))
    keep = (1 - 1e-4) * scene.s_lower[None]
    first, second = keep + 4e-5, keep + np.array([[1e-5, 1.2e-5, 1.5e-5]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        smaller = cut(scene, polytope, keep, [((0,), first, 1.0), ((1, 2), second, 1.0)], polytope).polytope
    assert smaller is not None
    assert not smaller.contains(np.concatenate([first, second])).any()
    assert smaller.contains(keep).all()


@pytest.mark.parametrize(("distance", "blocked"), [(1e-3, False), (1e-8, True), (1e-12, True)])
def test_a_face_is_not_put_within_a_hair_of_a_point_to_keep(distance, blocked):
    scene = planar_arm(2)
    polytope = scene.polytope([[1.0, 0.0]], [0.5])
    point = np.array([[distance, 0.0]])
    assert (cut(scene, polytope, np.zeros((1, 2)), [((0, 1), point, 1.0)], polytope).polytope is None) is blocked
