"""Find motions by tag and words, keep the longest, re-roll the others, and fetch what was kept.

python examples/search_and_review.py shot=010 kept
"""

import sys

from marey.client import Client


def main(tag: str, folder: str) -> None:
    with Client() as client:
        found = list(client.motions.list(tags=[tag], text="walks or waves", reviews=["new"]))
        if not found:
            print("nothing is left to review")
            return
        best = max(found, key=lambda motion: motion.seconds)
        client.motions.keep(best, comment="the longest")
        print(f"kept {best.prompt!r}, seed {best.seed}, {best.seconds:g} s")

        others = [motion for motion in found if motion.id != best.id]
        if others:
            client.motions.reject(others)
            for take in client.motions.reroll(others, comment="another take"):
                print(f"seed {take.seed} follows {take.motion[-8:]}")

        rewritten = client.motions.get(best).metadata.get("rewritten")
        print(f"it was read as {rewritten!r}")
        for fetched in client.jobs.fetch(best.job, folder, review="kept", formats=["npz"]):
            print(fetched.files["npz"])


if __name__ == "__main__":
    main(*sys.argv[1:])
