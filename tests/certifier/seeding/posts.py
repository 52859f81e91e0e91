"""A cart with an arm between posts, whose collisions trigonometry knows."""

import math

import numpy as np

from certifier.model import Geometry, Joint, JointKind, Pair, Scene


def ball(name, body, center, radius):
    return Geometry(name, body, np.array([center], dtype=float), radius, {"kind": "sphere", "radius": radius})


def posts(count):
    """A cart on rails along x with an arm of length 1 and a ball at its end, with this number of posts around the rails."""
    eye = np.eye(4)
    slide = Joint("slide", JointKind.PRISMATIC, "world", "cart", np.array([1.0, 0, 0]), eye, eye, 0, -2.0, 2.0)
    turn = Joint("turn", JointKind.REVOLUTE, "cart", "arm", np.array([0, 0, 1.0]), eye, eye, 1, -2.5, 2.5)
    hook = ball("hook", "arm", (1, 0, 0), 0.1)
    places = [(2.8 * math.cos(angle), 0.9 * math.sin(angle), 0) for angle in np.linspace(0.4, 2 * math.pi - 0.4, count)]
    balls = [ball(f"post{i}", "world", place, 0.1) for i, place in enumerate(places)]
    pairs = tuple(Pair("hook", post.name) for post in balls)
    return Scene("posts", (slide, turn), ("world", "arm", "cart"), (hook, *balls), pairs, (), np.zeros(2), 0.0)


def collisions(scene, C, d, count=200_000):
    """Returns the share of the region's volume in q, between 0 and 1, that is in collision, by trigonometry, and that volume."""
    rng = np.random.default_rng(0)
    q = rng.uniform((-2.0, -2.5), (2.0, 2.5), (count, 2))
    inside = (scene.to_s(q) @ C.T <= d).all(axis=1)
    hook = np.stack([q[:, 0] + np.cos(q[:, 1]), np.sin(q[:, 1])], axis=1)
    centers = np.array([scene.geometry(pair.b).vertices[0][:2] for pair in scene.pairs])
    touching = (np.linalg.norm(hook[:, None] - centers, axis=2) < 0.2).any(axis=1)
    return (touching & inside).sum() / inside.sum(), 20 * inside.mean()
