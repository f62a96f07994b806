"""A process that reads damaged files of a format: `python -m tests.support.fuzzing FORMAT SOURCE COUNT SEED`.

Only the two kinds of error of readers may come out; a warning is an error as well. Each file gets two seconds of
processor time, after which the process is killed, and 256 MiB of memory beside what the process holds already.
"""

from __future__ import annotations

import io
import signal
import sys
import tarfile
import tempfile
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random

import numpy as np

from marey.core.errors import InvalidFile, InvalidInput, TooLarge
from marey.core.memory import limit_memory
from marey.data.archive import bvh_files
from marey.exporters import Coordinates, exporters
from marey.motion.body_files import read_body
from marey.motion.clip import parse_npz
from marey.motion.export_options import ExportOptions
from marey.motion.io.bvh import parse_bvh
from marey.motion.io.fbx_read import parse_fbx
from marey.motion.io.glb_read import parse_glb
from marey.motion.io.rig_json import format_json_rig
from marey.motion.io.rig_smplx import JOINTS, VERTICES
from marey.motion.retarget.reference import reference_rig
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.read import parse_rig
from marey.motion.skeleton import HUMANML3D
from tests.support.archives import archive
from tests.support.damage import damaged, damaged_glb, damaged_npz, damaged_text
from tests.support.fbx import rewritten
from tests.support.walker import walker

SECONDS, MEMORY = 2.0, 2**28


@dataclass(frozen=True)
class Format:
    """Kind of file that is read.

    Attributes:
        damage: makes a damaged copy.
        readers: of the bytes.
        own: files that Marey writes, by a name.
        archived: files of others, by their names in the archive of rigs.
    """

    damage: Callable[[bytes, Random], bytes]
    readers: tuple[Callable[[bytes], object], ...]
    own: Mapping[str, Callable[[], bytes]]
    archived: tuple[str, ...] = ()


def rig(extension: str) -> Callable[[bytes], object]:
    """Reads a rig, and finds the parts of its body; a rig without legs is refused there."""

    def read(data: bytes) -> None:
        found = parse_rig(data, f"a.{extension}")
        with suppress(InvalidInput):
            RigBody.of(found)

    return read


def written(format: str, **options: object) -> bytes:
    return exporters()[format].write(walker(seconds=0.5), Coordinates.of(ExportOptions(**options), "cm", "y"))


def document_of(glb: bytes) -> bytes:
    return glb[20 : 20 + int.from_bytes(glb[12:16], "little")]


def packed(mode: str) -> bytes:
    """An archive of captures, compressed in a way that `tarfile` knows."""
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode=f"w:{mode}", format=tarfile.PAX_FORMAT) as tar:
        for name in ("set/walk.bvh", f"set/{'long' * 40}.bvh", "set/ä.bvh", "set/index.csv"):
            content = written("bvh")[:6000] if name.endswith("bvh") else b"a,b\n"
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return file.getvalue()


def unpack(data: bytes) -> None:
    """Reads all members of an archive of captures."""
    with tempfile.NamedTemporaryFile(suffix=".tar") as file:
        Path(file.name).write_bytes(data)
        for _ in bvh_files(Path(file.name)):
            pass


def body(data: bytes) -> None:
    """Reads proportions from an npz; a body that no human has is refused as a parameter is."""
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        Path(file.name).write_bytes(data)
        with suppress(InvalidInput):
            read_body(Path(file.name), HUMANML3D)


def smplx_model() -> bytes:
    random = np.random.default_rng(1)
    file = io.BytesIO()
    weights = np.zeros((len(JOINTS), VERTICES), np.float32)
    weights[np.arange(len(JOINTS)), np.arange(len(JOINTS))] = 1
    np.savez_compressed(file, v_template=random.normal(size=(VERTICES, 3)).astype(np.float32), J_regressor=weights)
    return file.getvalue()


GLB = {
    "plain": partial(written, "glb"),
    "body": partial(written, "glb", mesh=True),
    "rigged": partial(written, "glb", rig="ue4"),
}
BVH = {
    "plain": partial(written, "bvh"),
    "root bone": partial(written, "bvh", root_bone=True, tpose_frame=True),
    "rigged": partial(written, "bvh", rig="mixamo"),
}
FBX = {
    "plain": partial(written, "fbx"),
    "body, 7.5, packed": lambda: rewritten(written("fbx", mesh=True), 7500, packed=True),
    "rigged": partial(written, "fbx", rig="humanik"),
}
FORMATS = {
    "glb": Format(damaged_glb, (parse_glb, rig("glb")), GLB, ("rig-human.glb", "m2m-wrong-bone-names.glb")),
    "gltf": Format(
        damaged_text, (rig("gltf"),), {name: lambda make=make: document_of(make()) for name, make in GLB.items()}
    ),
    "vrma": Format(damaged_glb, (rig("vrma"),), {"plain": partial(written, "vrma")}, ("test.vrma",)),
    "bvh": Format(damaged_text, (parse_bvh, rig("bvh")), BVH),
    "fbx": Format(damaged, (parse_fbx, rig("fbx")), FBX, ("maya_human_ik_7400_binary.fbx", "91_48.fbx")),
    "json": Format(
        damaged_text,
        (rig("json"),),
        {
            name: partial(lambda each: format_json_rig(reference_rig(each)), name)
            for name in ("mixamo", "ue4", "humanik")
        },
    ),
    "npz": Format(damaged_npz, (parse_npz, body), {"plain": lambda: walker(seconds=0.5).to_npz()}),
    "archive": Format(damaged, (unpack,), {mode or "plain": partial(packed, mode) for mode in ("", "gz", "bz2", "xz")}),
    "smplx": Format(damaged_npz, (rig("npz"),), {"model": smplx_model}),
}


def main(format: str, source: str, count: int, seed: int) -> None:
    """Read so many damaged files, and print how many were read and how many refused."""
    chosen = FORMATS[format]
    if source == "own":
        files = {name: make() for name, make in chosen.own.items()}
    else:
        files = {name: archive(f"rigs/{name}").read_bytes() for name in chosen.archived}
    for name, data in files.items():  # what is imported and kept at first use
        for read in chosen.readers:
            with suppress(InvalidFile, TooLarge):
                read(data)
        print(f"{name}: {len(data)} bytes", flush=True)
    limit_memory(MEMORY, more=True)
    warnings.simplefilter("error")
    seen = {"read": 0, "refused": 0}
    for number in range(count):
        name = list(files)[number % len(files)]
        data = chosen.damage(files[name], Random(f"{name} {seed} {number}"))
        for read in chosen.readers:
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                read(data)
                seen["read"] += 1
            except (InvalidFile, TooLarge):
                seen["refused"] += 1
            except BaseException as error:
                raise AssertionError(f"{name}, seed {seed}, number {number}: {error!r}") from error
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
    print(seen)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
