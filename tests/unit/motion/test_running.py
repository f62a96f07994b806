"""Bodies that run: steps that carry them, and flights in which they fall."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from marey.motion.carrying import carrying_contacts
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import clean_feet, rule_for, runs, skate
from marey.motion.finish import finish_motion
from marey.motion.rotations import length
from marey.motion.running import GRAVITY, MOST_M, on_its_steps, running_frames, with_flights, with_running_steps
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import Body, runner, steady, walker

FPS = 20.0
Array = NDArray[np.float64]


def sliding(metres_a_second: float, body: Array | None = None) -> Array:
    """A run whose feet slide ahead while they stand, as those that networks make; its pelvis keeps its height."""
    joints = np.array(runner(4.0) if body is None else body, np.float64)
    joints[..., 2] += metres_a_second * (np.arange(len(joints)) / FPS)[:, None]
    return joints


def sprinter() -> Array:
    return Body(4.0, speed=steady(3.4), duty=0.3, cadence=3.0).joints()


def contacts_of(joints: Array) -> NDArray[np.bool_]:
    return carrying_contacts(joints, HUMANML3D, FPS, rule=rule_for(joints, FPS))


def going(joints: Array) -> NDArray[np.bool_]:
    return running_frames(joints, HUMANML3D, FPS)


def falls(joints: Array, contacts: NDArray[np.bool_]) -> Array:
    """Accelerations of the pelvis in the frames of flights that are between steps, metres a second squared."""
    flies = np.zeros(len(joints), bool)
    for begin, end in runs(~contacts.any(axis=1)):
        flies[begin:end] = begin > 4 and end < len(joints) - 4
    return (np.diff(joints[:, 0, 1], 2) * FPS**2)[flies[1:-1]]


def test_feet_that_are_clearly_slower_than_a_running_body_carry_it() -> None:
    joints = sliding(1.7, sprinter())
    known = contacts_of(joints)
    steps = with_running_steps(joints, known, going(joints), HUMANML3D, FPS)
    assert steps[known].all()
    counted = [sum(len(runs(each[:, toe])) for toe in (1, 3)) for each in (known, steps)]
    assert counted[1] >= 9 > counted[0]
    assert not (steps[:, :2].any(axis=1) & steps[:, 2:].any(axis=1)).any()
    clean, kept = clean_feet(joints, HUMANML3D, FPS, contacts=steps)
    assert kept[:, 1::2].sum() >= 0.9 * steps[:, 1::2].sum()
    assert skate(clean, kept, HUMANML3D, FPS) < 0.02


def test_a_body_that_walks_is_left() -> None:
    joints = np.asarray(walker(4.0), np.float64)
    known = contacts_of(joints)
    assert not going(joints).any()
    assert not going(joints[:2]).any()
    np.testing.assert_array_equal(with_running_steps(joints, known, going(joints), HUMANML3D, FPS), known)
    assert on_its_steps(joints, going(joints), HUMANML3D, FPS) is joints
    assert with_flights(joints, known, going(joints), HUMANML3D, FPS) is joints


@pytest.mark.parametrize("cadence", [2.6, 3.2])
def test_a_body_falls_in_the_flights_of_a_run(cadence: float) -> None:
    joints = sliding(1.0, Body(4.0, speed=steady(2.6), duty=0.3, cadence=cadence).joints())
    contacts = with_running_steps(joints, contacts_of(joints), going(joints), HUMANML3D, FPS)
    moved = with_flights(joints, contacts, going(joints), HUMANML3D, FPS)
    assert np.abs(falls(joints, contacts)).max() < 0.1
    assert falls(moved, contacts) == pytest.approx(-GRAVITY, abs=3.5)
    assert np.abs(moved[:, 0, 1] - joints[:, 0, 1]).max() < MOST_M
    assert abs(float((moved - joints)[:, 0, 1].mean())) < 0.015
    bones = list(zip(range(1, 22), HUMANML3D.parents[1:], strict=True))
    for joint, parent in bones:
        before, after = (length(each[:, joint] - each[:, parent]) for each in (joints, moved))
        np.testing.assert_allclose(after, before, atol=1e-6)
    for side, toe in ((1, 10), (3, 11)):
        stands = contacts[:, side]
        np.testing.assert_allclose(moved[stands, toe], joints[stands, toe], atol=0.03)


def test_leaps_and_the_ends_of_a_clip_are_no_flights_of_a_run() -> None:
    joints = sliding(1.0)
    contacts = contacts_of(joints)
    contacts[20:40] = False
    contacts[:6] = contacts[-6:] = False
    moved = with_flights(joints, contacts, going(joints), HUMANML3D, FPS)
    np.testing.assert_allclose(moved[25:35], joints[25:35], atol=0.01)


def test_a_run_that_drifts_up_comes_down_to_its_steps() -> None:
    joints = np.asarray(runner(4.0), np.float64)
    joints[30:50, :, 1] += 0.06
    down = on_its_steps(joints, going(joints), HUMANML3D, FPS)
    lowest = [each[33:47, [10, 11], 1].min() for each in (joints, down)]
    assert lowest[0] > 0.05
    assert lowest[1] < 0.01
    np.testing.assert_allclose(down[:20], joints[:20], atol=1e-9)
    np.testing.assert_array_equal(going(down), going(joints))


def test_a_finished_run_stands_on_its_steps_and_falls_between_them() -> None:
    joints = sliding(1.7, sprinter())
    clip = finish_motion(HUMANML3D_263.encode(joints), HUMANML3D_263)
    steps = sum(len(runs(clip.contacts[:, toe])) for toe in (1, 3))
    assert steps >= 9
    assert float(np.median(falls(clip.joints.astype(np.float64), clip.contacts))) < -0.6 * GRAVITY


def test_a_body_that_falls_in_its_flights_already_is_nearly_left() -> None:
    joints = sliding(1.0, Body(4.0, speed=steady(2.6), duty=0.3, cadence=2.6).joints())
    contacts = with_running_steps(joints, contacts_of(joints), going(joints), HUMANML3D, FPS)
    once = with_flights(joints, contacts, going(joints), HUMANML3D, FPS)
    again = with_flights(once, contacts, going(once), HUMANML3D, FPS)
    first, second = (np.abs(np.diff(change[:, 0, 1])).max() for change in (once - joints, again - once))
    assert second < 0.7 * first


def test_a_run_between_stands_passes_into_them_without_a_jump() -> None:
    joints = sliding(1.0, Body(4.0, speed=steady(2.6), duty=0.3, cadence=2.6).joints())
    steps = with_running_steps(joints, contacts_of(joints), going(joints), HUMANML3D, FPS)
    stand = np.ones((30, 4), bool)
    whole = np.concatenate([np.repeat(joints[:1], 30, axis=0), joints, np.repeat(joints[-1:], 30, axis=0)])
    moved = with_flights(whole, np.concatenate([stand, steps, stand]), going(whole), HUMANML3D, FPS)
    change = np.abs(moved - whole)[:, 0, 1]
    first, *_, last = np.flatnonzero(change)
    assert 0 < first < last < len(whole) - 1
    assert change[[first, last]].max() < 1e-6
    assert change.max() > 0.01


def test_a_run_that_is_played_backwards_has_the_same_flights() -> None:
    joints = np.array(Body(6.0, speed=lambda t: np.interp(t, [1.5, 2.0, 3.5, 4.1], [0.0, 3.5, 3.5, 0.0])).joints())
    contacts, runs = np.ones((len(joints), 4), bool), np.ones(len(joints), bool)
    for begin, end in ((45, 49), (54, 57), (61, 66)):
        contacts[begin:end] = False
    there = with_flights(joints, contacts, runs, HUMANML3D, FPS)[:, 0]
    back = with_flights(joints[::-1], contacts[::-1], runs, HUMANML3D, FPS)[::-1, 0]
    assert np.abs(there - joints[:, 0]).max() > 0.01
    np.testing.assert_allclose(back, there, atol=1e-6)
