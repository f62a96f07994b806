from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from marey.motion import rotations as r

unit = st.floats(-1, 1, allow_nan=False, width=32)
quaternions = arrays.arrays(np.float64, (6, 4), elements=unit).map(
    lambda q: r.normalize(np.where(np.linalg.norm(q, axis=-1, keepdims=True) < 1e-3, [1.0, 0, 0, 0], q))
)
vectors = arrays.arrays(np.float64, (6, 3), elements=st.floats(-3, 3, allow_nan=False, width=32))
ORDERS = ["".join(p) for p in itertools.permutations("XYZ")]


def same_rotation(a, b, tolerance=1e-6):
    return r.angle_between(a, b).max() < tolerance


@given(quaternions, vectors)
def test_a_quaternion_turns_vectors_as_its_matrix_does(q, v):
    np.testing.assert_allclose(r.rotate(q, v), np.einsum("nij,nj->ni", r.to_matrix(q), v), atol=1e-9)


@given(quaternions, quaternions, vectors)
def test_a_product_turns_by_its_right_factor_first(a, b, v):
    np.testing.assert_allclose(r.rotate(r.multiply(a, b), v), r.rotate(a, r.rotate(b, v)), atol=1e-9)


@given(quaternions)
def test_matrix_and_6d_round_trip(q):
    assert same_rotation(r.from_matrix(r.to_matrix(q)), q)
    assert same_rotation(r.from_6d(r.to_6d(q)), q)


def test_6d_is_the_first_two_columns():
    quarter = r.about("Z", np.pi / 2)  # x to y, y to -x
    np.testing.assert_allclose(r.to_6d(quarter), [0, 1, 0, -1, 0, 0], atol=1e-12)


@given(quaternions, st.sampled_from(ORDERS))
def test_euler_angles_round_trip_in_every_order(q, order):
    angles = r.to_euler(q, order)
    assert np.abs(angles[:, 1]).max() <= 90 + 1e-9
    assert same_rotation(r.from_euler(angles, order), q, 2e-5)  # the square root of rounding, near the lock


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("middle", [90.0, -90.0])
def test_euler_angles_survive_the_gimbal_lock(order, middle):
    q = r.from_euler(np.array([[30.0, middle, 50.0]]), order)
    assert same_rotation(r.from_euler(r.to_euler(q, order), order), q, 1e-6)


def test_the_first_axis_named_is_the_outermost():
    q = r.from_euler(np.array([90.0, 90.0, 0.0]), "ZXY")
    np.testing.assert_allclose(r.rotate(q, np.array([0.0, 1.0, 0.0])), [0, 0, 1], atol=1e-12)  # X takes y to z; Z not z


def test_continuous_euler_angles_take_the_neighbouring_triple():
    true = np.stack([np.linspace(0, 400, 80), np.linspace(60, 130, 80), np.linspace(-170, 200, 80)], axis=1)
    angles = r.to_euler(r.from_euler(true, "ZYX"), "ZYX")
    smooth = r.continuous_euler(angles)
    assert np.abs(np.diff(angles, axis=0)).max() > 90
    assert np.abs(np.diff(smooth, axis=0)).max() < 10
    assert same_rotation(r.from_euler(smooth, "ZYX"), r.from_euler(true, "ZYX"), 1e-5)


@given(vectors, vectors)
def test_between_turns_one_direction_into_the_other(a, b):
    a, b = (np.where(np.linalg.norm(v, axis=-1, keepdims=True) < 1e-2, [1.0, 0, 0], v) for v in (a, b))
    np.testing.assert_allclose(r.rotate(r.between(a, b), r.normalize(a)), r.normalize(b), atol=1e-4)


@pytest.mark.parametrize("axis", np.eye(3))
def test_between_opposite_directions_is_half_a_turn(axis):
    q = r.between(axis, -axis)
    np.testing.assert_allclose(r.rotate(q, axis), -axis, atol=1e-9)
    assert np.linalg.norm(q) == pytest.approx(1)


@given(arrays.arrays(np.float64, (6, 3), elements=st.floats(-1.75, 1.75, width=32)))
def test_rotation_vectors_round_trip(v):
    np.testing.assert_allclose(r.to_rotvec(r.from_rotvec(v)), v, atol=1e-6)


@given(quaternions, quaternions, st.floats(0, 1))
def test_slerp_goes_the_short_way_at_an_even_pace(a, b, t):
    whole = r.angle_between(a, b)
    part = r.angle_between(a, r.slerp(a, b, np.full(len(a), t)))
    np.testing.assert_allclose(part, t * whole, atol=2e-3)


def test_unroll_leaves_no_sign_change_between_frames():
    q = r.about("Y", np.linspace(0, 4 * np.pi, 50))
    flipped = q * np.where(np.random.default_rng(0).random(50) < 0.5, -1, 1)[:, None]
    steps = np.einsum("ti,ti->t", *(lambda u: (u[1:], u[:-1]))(r.unroll(flipped)))
    assert steps.min() > 0.9


@given(quaternions, vectors, vectors)
def test_aimed_is_the_shortest_way_from_where_the_bone_points(q, bone, aim):
    bone = r.normalize(np.where(np.linalg.norm(bone, axis=-1, keepdims=True) < 1e-2, [1.0, 0, 0], bone))
    expected = r.multiply(r.between(r.rotate(q, bone), aim), q)
    opposite = r.dot(r.rotate(q, bone), r.normalize(aim)) < -0.999999  # any axis across will do
    assert r.angle_between(r.aimed(q, bone, aim), expected)[~opposite].max(initial=0) < 1e-6


@pytest.mark.parametrize("axis", np.eye(3))
def test_aimed_at_the_opposite_is_half_a_turn_and_at_nothing_is_none(axis):
    q = r.about("X", np.array([0.3]))
    back = r.aimed(q, axis[None], -r.rotate(q, axis[None]))
    np.testing.assert_allclose(r.rotate(back, axis), -r.rotate(q, axis), atol=1e-9)
    np.testing.assert_allclose(r.aimed(q, axis[None], np.zeros((1, 3))), q, atol=1e-12)


@pytest.mark.parametrize(
    ("function", "widths"),
    [
        (r.dot, (3, 3)),
        (r.length, (4,)),
        (r.normalize, (4,)),
        (r.cross, (3, 3)),
        (r.multiply, (4, 4)),
        (r.rotate, (4, 3)),
        (r.between, (3, 3)),
        (r.aimed, (4, 3, 3)),
    ],
)
def test_no_bit_of_a_row_depends_on_the_rows_beside_it(function, widths):
    random = np.random.default_rng(0)
    rows = [r.normalize(random.normal(size=(9, 5, width))) for width in widths]
    together = function(*rows)
    for k in range(9):
        np.testing.assert_array_equal(function(*(v[k : k + 1] for v in rows))[0], together[k])
