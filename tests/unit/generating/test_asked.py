"""Motions on the side, as often and at the pace that their prompt names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from marey.generation.asked import SPEEDS, AskedMotion, generate_as_asked
from marey.generation.port import KeptFrames, Limits, Request
from marey.generation.shots.windows import no_text
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import raiser, waver


@dataclass(frozen=True)
class RawMotion:
    features: np.ndarray[Any, Any]


class OneMotion:
    """A generator that makes the same motion for every request."""

    layout = HUMANML3D_263
    limits = Limits(16, 400, 20.0, 4)

    def __init__(self, joints: np.ndarray[Any, Any]) -> None:
        self.made = RawMotion(self.layout.encode(joints))

    def generate(self, requests: Sequence[Request], settings: Any, *, control: Any) -> list[Any]:
        self.frames = [request.frames for request in requests]
        return [self.made for _ in requests]


def ask(prompt: str) -> Request:
    return Request(replace(no_text(4), prompt=prompt, rewritten=prompt), 1)


def make(joints: np.ndarray[Any, Any], request: Request) -> Any:
    (made,) = generate_as_asked(OneMotion(joints), [request])  # type: ignore[arg-type]
    return made


def test_the_wrong_hand_is_mirrored() -> None:
    made = make(waver("left"), ask("a man waves with his right hand"))
    assert isinstance(made, AskedMotion)
    assert made.changes == {"mirrored": True}
    mirrored = HUMANML3D_263.decode(made.features)
    left = HUMANML3D_263.canonicalize(waver("left"))[: len(mirrored)]
    np.testing.assert_allclose(mirrored, HUMANML3D_263.mirror_joints(left), atol=1e-4)


@pytest.mark.parametrize(
    ("joints", "prompt"),
    [
        (waver("left"), "a man waves with his left hand"),
        (waver("left"), "a man waves"),
        (raiser("both"), "a man waves with his right hand"),
        (waver("left"), "a man walks to the right"),
        (waver("both"), "a man waves with his right hand"),
    ],
    ids=["right side", "no side", "neither side", "no rule for the side", "both sides"],
)
def test_motions_that_a_mirror_does_not_help_stay(joints: np.ndarray[Any, Any], prompt: str) -> None:
    assert isinstance(make(joints, ask(prompt)), RawMotion)


def test_motions_around_kept_frames_are_not_mirrored() -> None:
    asked = ask("a man waves with his right hand")
    kept = KeptFrames(0, np.zeros((4, 263), np.float32))
    assert isinstance(make(waver("left"), replace(asked, kept=(kept,))), RawMotion)
    assert isinstance(make(waver("left"), replace(asked, free=True)), RawMotion)
