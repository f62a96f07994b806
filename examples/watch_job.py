"""Submit prompts from Python and watch the job, with its progress.

python examples/watch_job.py
"""

from marey.client import Client, Item, Progress


def show(progress: Progress) -> None:
    """Print a line for each change."""
    print(f"{progress.state}: {progress.done} of {progress.total}")
    if progress.event is not None and progress.event.item is not None:
        print(f"  item {progress.event.item}: {progress.event.reason}")


def main() -> None:
    rows = [
        "a person walks forward",
        {"prompt": "a person waves with the left hand", "seconds": 3, "tags": ["shot=010"]},
        Item("a person bows deeply", variants=2, seed=7),
    ]
    with Client() as client:
        print(f"would make {client.jobs.check(rows).items} motions")
        job = client.jobs.submit(rows, name="watched", priority=10, seconds=2.0)
        ended = client.jobs.wait(job, timeout=600, on_progress=show, check=False)
        for item in client.jobs.items(ended):
            print(item.prompt, item.seed, item.state, item.error.message if item.error else "")


if __name__ == "__main__":
    main()
