"""An export format from a package of its own: written, fetched, converted and erased without an edit of the product."""

from __future__ import annotations

import csv
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from marey.motion.clip import load_npz
from tests.support.glb import Glb
from tests.support.marey import TINY, Marey

SECRET = "zanzibar"
PROMPT = f"a person walks to {SECRET}"


def test_it_is_written_fetched_converted_and_erased(served: Marey, tmp_path: Path) -> None:
    marey, folder = served, tmp_path / "clips"
    (line,) = marey("submit", PROMPT, "--bundle", TINY, "--seconds", 2, "--fetch", folder, "--json").ok().lines
    assert sorted(line["files"]) == ["bvh", "npz", "poses"]
    file = Path(line["files"]["poses"])
    assert file.suffix == ".pose"
    poses, npz = json.loads(file.read_bytes()), load_npz(line["files"]["npz"])
    np.testing.assert_array_equal(np.array(poses["rotations"], np.float32), npz.rotations)
    assert poses["manifest"]["prompt"] == PROMPT

    with (folder / "manifest.csv").open(newline="", encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert row["file:poses"] == file.name
    with marey.client() as client:
        motion = client.get(f"/v1/motions/{line['motion']}")
        (stored,) = (each for each in motion["files"] if each["format"] == "poses")
        assert stored["media_type"] == "application/json"
        with client.stream(f"/v1/motions/{line['motion']}/files/poses", {}) as answer:
            assert answer.headers["Content-Type"] == "application/json"
            assert answer.headers["Content-Disposition"].endswith('.pose"')
            assert b"".join(answer.iter_bytes()) == file.read_bytes()

    marey("convert", file, tmp_path / "again.npz").ok()
    np.testing.assert_array_equal(load_npz(tmp_path / "again.npz").joints, npz.joints)
    marey("convert", file, tmp_path / "again.bvh").ok()
    assert (tmp_path / "again.bvh").read_bytes() == Path(line["files"]["bvh"]).read_bytes()

    marey("jobs", "erase", line["job"], "--yes").ok()
    after = tmp_path / "after"
    fetched = fetch_erased(marey, line["job"], after)
    erased = Path(fetched["files"]["poses"]).read_bytes()
    assert SECRET.encode() not in erased
    assert json.loads(erased)["manifest"]["erased"] is True
    assert json.loads(erased)["rotations"] == poses["rotations"]
    glb = marey("fetch", line["job"], "-o", after, "--format", "glb", "--json", "--overwrite").ok().lines[0]
    of_glb = Glb.read(Path(glb["files"]["glb"]).read_bytes())
    assert of_glb.extras["manifest"]["erased"] is True
    np.testing.assert_allclose(of_glb.joints(), npz.joints, atol=1e-3)
    check_secret_gone(marey.home / "assets")


def fetch_erased(marey: Marey, job: str, folder: Path) -> dict[str, Any]:
    """Fetch the three files of an erased job, which the scheduler rewrites; return the line of its motion."""
    deadline = time.monotonic() + 60
    while True:
        fetched = marey("fetch", job, "-o", folder, "--json", "--overwrite").ok().lines[0]
        if len(fetched["files"]) >= 3:
            return fetched
        assert time.monotonic() < deadline, fetched
        time.sleep(0.5)


def check_secret_gone(assets: Path) -> None:
    stored_files = [path for path in assets.rglob("*") if path.is_file()]
    assert len(stored_files) >= 3
    for path in stored_files:
        data = path.read_bytes()
        assert not any(SECRET.encode(coding) in data for coding in ("utf-8", "utf-32-le")), path


def test_it_is_generated_without_a_server(installed: Marey, tmp_path: Path) -> None:
    line = installed(
        "generate", PROMPT, "--bundle", TINY, "--seconds", 2, "--seed", 1, "--format", "poses", "-o", tmp_path, "--json"
    ).ok().lines[0]  # fmt: skip
    assert list(line["files"]) == ["poses"]
    assert json.loads(Path(line["files"]["poses"]).read_bytes())["manifest"]["prompt"] == PROMPT


def test_the_product_alone_does_not_know_it(installed: Marey, offline: Marey, tmp_path: Path) -> None:
    offline("generate", PROMPT, "--bundle", TINY, "--format", "poses", "-o", tmp_path).refused(
        2, "'poses' is not a known motion format", "bvh, fbx, gif, glb, mp4, npz, smplx, usd, vrma, webp"
    )
    (tmp_path / "a.pose").write_text("{}")
    offline("convert", tmp_path / "a.pose", tmp_path / "b.npz").refused(
        2, "Known: .bvh, .fbx, .gif, .glb, .mp4, .npz, .smplx.npz, .usd, .vrma, .webp."
    )
    installed("convert", tmp_path / "a.pose", tmp_path / "b.npz").refused(2, "not a file of poses")
