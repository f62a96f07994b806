"""Make a motion in this process, without a server; shorten it, and convert it.

    python examples/generate_locally.py "a person waves" wave

Needs `pip install 'marey[worker]'` and a bundle.
"""

import sys

from marey.generate import load
from marey.motion import MotionClip, clip_from_bvh, load_npz, read_bvh, write_bvh


def first_second(clip: MotionClip) -> MotionClip:
    """The first second of a clip."""
    frames = round(clip.fps)
    return MotionClip.of(
        clip.skeleton,
        clip.rotations[:frames],
        clip.root[:frames],
        clip.contacts[:frames],
        clip.fps,
        manifest=clip.manifest,
    )


def main(prompt: str, name: str, model: str = "hgm3") -> None:
    (clip,) = load(model).generate([prompt], seed=1, seconds=2.0)
    clip.save_npz(f"{name}.npz")
    print(f"{clip.frames} frames of {clip.seconds:g} s by {clip.manifest['bundle']}")

    write_bvh(f"{name}-short.bvh", first_second(load_npz(f"{name}.npz")), unit="cm", up="y")
    print(f"{len(read_bvh(f'{name}-short.bvh').root)} frames are left")

    write_bvh(f"{name}-z-up.bvh", clip, unit="m", up="z")
    back = clip_from_bvh(read_bvh(f"{name}-z-up.bvh", unit="m", up="z"), f"{name}-z-up.bvh")
    print(f"{back.frames} frames came back at {back.fps:g} a second")


if __name__ == "__main__":
    main(*sys.argv[1:])
