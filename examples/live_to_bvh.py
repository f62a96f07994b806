"""Stream motion while it is made, steer it, and write it to a BVH file that grows.

    python examples/live_to_bvh.py walk.bvh

Writing the file needs `pip install 'marey[motion]'`.
"""

import sys

from marey.client import Client


def main(path: str) -> None:
    with Client() as client, client.streams.open("a person walks forward", seconds=4.0, seed=1) as live:
        live.record(path)
        frames = 0
        for frame in live:
            frames += 1
            if frames == 20:
                live.steer("a person waves with the right hand")
            if frames % 20 == 0:
                x, _, z = frame.root
                print(f"frame {frame.number}: prompt {frame.prompt}, at {x:.2f} m, {z:.2f} m")
        print(f"{live.stream.state}: {frames} frames, {live.missing} missing")
        print(*(prompt.prompt for prompt in live.stream.prompts), sep="\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
