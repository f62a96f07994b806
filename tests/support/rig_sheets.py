"""Sheets of five recorded motions on every rig at hand, to be looked at.

    python -m tests.support.rig_sheets OUT [RIG...]

OUT gets a PNG a rig: five rows of poses, and below each the way from above. RIG is a part of the name of rigs. The
motions and most rigs come from the capture archives, see `tests.support.archives`.
"""

from __future__ import annotations

import sys
import tarfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from marey.core.errors import InvalidInput
from marey.exporters import write_rigged
from marey.exporters.convert import convert
from marey.motion.clip import MotionClip, load_npz
from marey.motion.export_options import REFERENCE_RIGS
from marey.motion.retarget import load_body, retarget
from marey.motion.retarget.load import parse_body
from marey.motion.retarget.source import Source
from marey.motion.rigs.body import RigBody
from marey.viz.render import contact_sheet
from tests.support.archives import archive
from tests.support.cmu_pairs import iclone_trial

TRIALS = {
    "002_04": "jumps", "005_09": "dances", "006_05": "plays basketball", "007_04": "walks slowly",
    "001_01": "hops and turns",
}  # fmt: skip
SECONDS = 8


def rigs() -> Iterator[tuple[str, RigBody]]:
    """Yield the reference skeletons, the rigs of the folder `rigs`, and one of each kind in the archive."""
    for name in REFERENCE_RIGS:
        yield name, load_body(name)
    for path in sorted(archive("rigs/rig-human.glb").parent.iterdir()):
        if path.suffix in (".glb", ".fbx", ".vrma"):
            yield from _read(path.name, path.read_bytes(), path.name)
    seen: set[tuple[str, bytes]] = set()
    with tarfile.open(archive("open-motions.tar.xz"), "r|*") as tar:
        for member in tar:
            if member.name.endswith(".bvh") and (file := tar.extractfile(member)):
                data, folder = file.read(), Path(member.name).parts[-3]
                joints = b" ".join(line for line in data.partition(b"MOTION")[0].splitlines() if b"JOINT" in line)
                if (folder, joints) not in seen:
                    seen.add((folder, joints))
                    yield from _read(f"{folder}-{Path(member.name).stem}", data, Path(member.name).name)


def _read(name: str, data: bytes, file: str) -> Iterator[tuple[str, RigBody]]:
    """Yield the rig of a file, or say why it is none."""
    try:
        yield name, parse_body(data, file)
    except InvalidInput as error:
        print(f"{name}: {error}")


def beginning(source: Source) -> Source:
    """Return the first seconds of a motion."""
    own = slice(round(SECONDS * source.fps))
    turned, joints, contacts = source.turned[own], source.joints[own], source.contacts[own]
    return replace(source, turned=turned, joints=joints, contacts=contacts)


def on_rig(source: Source, body: RigBody) -> MotionClip:
    """Return a motion on a rig as a clip of the rig's joints, the way a file of it is read back."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.glb"
        write_rigged(path, retarget(source, body))
        convert(path, path.with_suffix(".npz"))
        return load_npz(path.with_suffix(".npz"))


if __name__ == "__main__":
    target, *chosen = sys.argv[1:]
    Path(target).mkdir(parents=True, exist_ok=True)
    sources = {name: beginning(iclone_trial(name)) for name in TRIALS}
    for rig, body in rigs():
        if not chosen or any(part in rig for part in chosen):
            clips = [on_rig(source, body) for source in sources.values()]
            contact_sheet(clips, Path(target) / f"{rig}.png", title=rig, captions=list(TRIALS.values()))
            print(rig)
