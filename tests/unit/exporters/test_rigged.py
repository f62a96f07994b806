"""Files of motions that are on a rig already."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from marey.core.errors import InvalidInput
from marey.exporters import Coordinates, exporter_of, write_rigged
from marey.motion.retarget import load_body, on_body
from tests.support.walker import walker

CLIP = walker(seconds=0.5)
MOTION = on_body(CLIP, load_body("mixamo"))


@pytest.mark.parametrize("name", ["bvh", "fbx", "glb"])
def test_a_file_is_that_of_an_export_onto_the_rig(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"walk.{name.upper()}"
    write_rigged(path, MOTION)
    assert path.read_bytes() == exporter_of(name).write(CLIP, Coordinates(rig="mixamo"))


def test_formats_without_rigs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="npz files hold no rig") as error:
        write_rigged(tmp_path / "walk.npz", MOTION)
    assert error.value.hint == "Endings that do: .bvh, .fbx, .glb, .smplx.npz, .usd."
    with pytest.raises(InvalidInput, match=r"`\.obj` is not a known motion format"):
        write_rigged(tmp_path / "walk.obj", MOTION)
    assert not list(tmp_path.iterdir())


def test_its_former_place_still_has_it() -> None:
    from marey.motion import retarget

    assert retarget.write_rigged is write_rigged


@pytest.mark.parametrize("rig", ["mixamo", "ue4", "humanik"])
def test_rotations_of_a_glb_pass_one_by_no_rounding(rig: str) -> None:
    data = exporter_of("glb").write(CLIP, Coordinates(rig=rig))
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert max(abs(number) for node in document["nodes"] for number in node["rotation"]) <= 1
