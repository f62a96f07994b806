"""Measure a model twice, with two settings, and compare the runs.

python examples/evaluate.py hgm3
"""

import sys

from marey.client import Client, EvaluationDetail

PROMPTS = [
    {"prompt": "a person walks forward", "seconds": 2, "expected": "walk straight"},
    {"prompt": "a person waves with the left hand", "seconds": 2, "expected": "wave left"},
]


def show(run: EvaluationDetail) -> None:
    """Print how far a run is."""
    job = run.scoring or run.generation
    print(f"{run.name}: {run.state}" + (f", {job.ended} of {job.total}" if job else ""))


def main(bundle: str) -> None:
    with Client() as client:
        before = client.evaluations.run(bundle, prompts=PROMPTS, name="before")
        before = client.evaluations.wait(before, timeout=900, on_progress=show)
        after = client.evaluations.run(
            bundle, prompts=PROMPTS, name="after", settings={"guidance": 2.0}, baseline=before
        )
        after = client.evaluations.wait(after, timeout=900, on_progress=show)
        for change in client.evaluations.compare(before, after).changes:
            print(f"{change.metric}: {change.before:.1f} -> {change.after:.1f} % ({change.verdict})")
        print(client.evaluations.report(after).splitlines()[0])


if __name__ == "__main__":
    main(*sys.argv[1:])
