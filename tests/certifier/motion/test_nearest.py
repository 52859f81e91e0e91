"""How far hulls are apart, beside what boxes are built with and beside least squares that share nothing with the search."""

import numpy as np
import pytest
from scipy.optimize import nnls

from certifier.motion.nearest import farther, separation

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2.0


PLATES = [
    (
        0.00043993041,
        [
            [2.108341059401983, -0.31768833910095595, 1.504054138622508],
            [2.1031350926152856, -0.3190769485623115, 1.50717602603692],
            [0.3808971376023794, 3.989669348714867, 0.5393242671590107],
            [0.37569117081568193, 3.9882807392535113, 0.5424461545734228],
            [2.161036691504579, -0.2723577881403638, 1.6120907516423841],
            [2.1558307247178816, -0.27374639760171937, 1.6152126390567965],
            [0.4335927697049754, 4.0349998996754595, 0.647360880178887],
            [0.4283868029182779, 4.033611290214104, 0.6504827675932991],
        ],
        [
            [2.2818188300663476, -0.5692246992643919, 1.6782624461349696],
            [2.27746561574594, -0.5703858504665225, 1.6808729593318354],
            [1.2884122236248046, 1.907821026726705, 1.1234722062614018],
            [1.284059009304397, 1.9066598755245745, 1.1260827194582677],
            [2.3909181410096783, -0.4753738111138628, 1.9019379115733874],
            [2.386564926689271, -0.47653496231599335, 1.9045484247702533],
            [1.3975115345681353, 2.0016719148772344, 1.3471476716998196],
            [1.393158320247728, 2.000510763675104, 1.3497581848966855],
        ],
    ),
    (
        0.000309662939,
        [
            [-1.4187451582268829, 0.4301832027021546, 2.1184423589248915],
            [0.3542435221999912, 2.960028517804683, -0.7417824325271682],
            [-1.422262347681917, 0.42720340361115094, 2.1136265249029713],
            [0.35072633274495724, 2.957048718713679, -0.7465982665490885],
            [-1.0495127706786782, 0.09853771771840636, 2.0539834627422993],
            [0.723475909748196, 2.6283830328209348, -0.8062413287097607],
            [-1.053029960133712, 0.0955579186274027, 2.0491676287203786],
            [0.7199587202931619, 2.625403233729931, -0.8110571627316809],
        ],
        [
            [-0.9958459473047898, 0.17541935469202952, 1.9634312244819716],
            [-0.9478368952243028, 0.24392259829936647, 1.8859819533779616],
            [-0.9988642237859725, 0.1728622398052686, 1.9592985160363583],
            [-0.9508551717054855, 0.24136548341260555, 1.8818492449323483],
            [-0.9889195298459138, 0.169198028625261, 1.9622220423003551],
            [-0.9409104777654268, 0.23770127223259796, 1.8847727711963451],
            [-0.9919378063270965, 0.1666409137385001, 1.9580893338547418],
            [-0.9439287542466095, 0.23514415734583705, 1.8806400627507318],
        ],
    ),
    (
        0.00029338293,
        [
            [-1.398540636132872, 1.0320889210874906, 1.549922708741042],
            [-1.3961317542189409, 1.040576128988882, 1.5422725158720147],
            [-2.2811273325579835, 0.5365623778190612, 0.7222724739990746],
            [-2.2787184506440523, 0.5450495857204526, 0.7146222811300474],
            [2.0795206268323367, -1.7804025744166339, -0.47511920020993564],
            [2.081929508746268, -1.7719153665152425, -0.48276939307896277],
            [1.1969339304072253, -2.275929117685063, -1.3027694349519028],
            [1.1993428123211565, -2.2674419097836718, -1.3104196278209301],
        ],
        [
            [4.558765147068482, -0.39195713013262234, 1.8539846078459365],
            [4.560022746924445, -0.3875262315598902, 1.84999068793042],
            [1.6734796352024521, -2.0118949354820024, -0.8517067886662277],
            [1.674737235058415, -2.00746403690927, -0.8557007085817443],
            [4.74527512356276, -0.5427761304482241, 1.7453923519072425],
            [4.746532723418723, -0.538345231875492, 1.741398431991726],
            [1.8599896116967305, -2.162713935797604, -0.9602990446049218],
            [1.8612472115526935, -2.158283037224872, -0.9642929645204383],
        ],
    ),
]
"""How far two plates are apart, in metres, and their corners."""


def rotation(rng):
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.diag(R))


def plates(rng, gap):
    """Returns two thin boxes whose large faces are parallel and a gap apart, above each other for a part."""
    R, far = rotation(rng), rng.uniform(-2, 2, 3)
    sizes = np.exp(rng.uniform(np.log(0.1), np.log(5), (2, 3)))
    sizes[:, 2] = rng.uniform(0.005, 0.02, 2)
    shift = np.append(rng.uniform(-0.5, 0.5, 2) * sizes.min(axis=0)[:2], sizes[:, 2].sum() / 2 + gap)
    return (CORNERS * sizes[0] + shift) @ R.T + far, (CORNERS * sizes[1]) @ R.T + far


def least_squares(A, B):
    """Returns the distance of two hulls by a least-squares problem with weights that are not negative."""
    scale = 1e4
    M = np.vstack(
        [
            np.hstack([A.T, -B.T]),
            scale * np.hstack([np.ones(len(A)), np.zeros(len(B))]),
            scale * np.hstack([np.zeros(len(A)), np.ones(len(B))]),
        ]
    )
    x = nnls(M, np.array([0.0, 0.0, 0.0, scale, scale]), maxiter=10_000)[0]
    a, b = x[: len(A)] / x[: len(A)].sum(), x[len(A) :] / x[len(A) :].sum()
    return float(np.linalg.norm(a @ A - b @ B))


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4, 1e-5])
def test_parallel_plates_are_as_far_apart_as_they_are_built(gap):
    """Most vertices of these are nearly in one plane, so tetrahedra of their differences are flat."""
    rng, normal = np.random.default_rng(0), np.empty(3)
    for _ in range(5_000):
        A, B = plates(rng, gap)
        assert separation(A, B, normal) == pytest.approx(gap, rel=1e-6, abs=1e-11)


@pytest.mark.parametrize(("gap", "a", "b"), PLATES)
def test_plates_of_which_rounding_says_that_they_meet(gap, a, b):
    """Differences of their corners make a flat tetrahedron, and by the signs of its volumes 0 is inside."""
    assert separation(np.array(a), np.array(b), np.empty(3)) == pytest.approx(gap, rel=1e-6)


def test_hulls_at_any_turn_are_apart_as_least_squares_say():
    rng, normal = np.random.default_rng(1), np.empty(3)
    for _ in range(300):
        A, B = rng.normal(size=(7, 3)), rng.normal(size=(9, 3)) + rng.normal(size=3) * 3
        found, known = separation(A, B, normal), least_squares(A, B)
        assert max(found, 0.0) == pytest.approx(known, abs=1e-6)


def test_hulls_that_meet_are_not_apart():
    rng, normal = np.random.default_rng(2), np.empty(3)
    for _ in range(5_000):
        A, B = plates(rng, -1e-6)
        assert separation(A, B, normal) <= 0


def test_hulls_are_farther_apart_than_something_whatever_direction_is_tried_first():
    rng = np.random.default_rng(4)
    answers = {True: 0, False: 0}
    normal = np.zeros(3)
    for _ in range(400):
        A, B = rng.normal(size=(8, 3)), rng.normal(size=(8, 3)) + rng.uniform(0, 4, 3)
        distance = max(separation(A, B, np.empty(3)), 0.0)
        for reach in (0.0, 0.5 * distance, max(distance - 1e-7, 0.0), distance + 1e-7, 2 * distance + 0.1):
            for first in (normal, np.zeros(3), rng.normal(size=3)):
                found = farther(A, B, reach, first)
                assert found == (distance > reach)
                if found:
                    unit = first / np.linalg.norm(first)
                    assert (A @ unit).min() - (B @ unit).max() > reach - 1e-12
        answers[bool(distance > 0)] += 1
    assert min(answers.values()) > 30
