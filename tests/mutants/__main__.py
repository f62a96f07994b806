"""Mutation tests of models, jobs and motion: `make mutants`, or `python -m tests.mutants --help`."""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import queue
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from marey.embedded import start_postgres, start_valkey
from tests.mutants.drawing import GROUPS, Mutant, draw
from tests.mutants.mapping import LineMap, current_map
from tests.mutants.report import KILLS, describe, read_equivalents
from tests.mutants.selection import Selector

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".mutants"
LIMIT_S = 60.0
PRELOADED = (
    "alembic",
    "celery",
    "cryptography.fernet",
    "fastapi",
    "httpx2",
    "hypothesis",
    "limits",
    "minio",
    "numpy",
    "opentelemetry.sdk.trace",
    "PIL.Image",
    "prometheus_client",
    "pydantic_settings",
    "redis",
    "rich.console",
    "schemathesis",
    "scipy.stats",
    "sqlalchemy.dialects.postgresql",
    "structlog",
    "torch",
    "torch.utils.tensorboard",
    "typer",
    "uvicorn",
    "websockets.sync.client",
)
"""Packages that a warm process loads before it forks."""


def main() -> None:
    """Draw mutants, run the tests that cover each, and report."""
    options = _options()
    FOLDER.mkdir(exist_ok=True)
    seed = options.seed if options.seed is not None else random.SystemRandom().randrange(10**6)
    print(f"seed {seed}: make mutants SEED={seed} goes on where this run stops", flush=True)
    known = LineMap.load(FOLDER / "map.json") if options.keep_map else current_map(ROOT, FOLDER, options.processes)
    mutants = [mutant for group in options.group or GROUPS for mutant in draw(ROOT, group, options.number, seed)]
    results = _Results(FOLDER / f"results-{seed}.jsonl")
    selector = Selector(ROOT, known)
    waiting: queue.SimpleQueue[tuple[Mutant, list[str]]] = queue.SimpleQueue()
    order = list(mutants)
    random.Random(seed).shuffle(order)
    for mutant in order:
        tests = selector.select(mutant.mutation)
        if not results.holds(mutant, tests):
            waiting.put((mutant, tests))
    print(f"{waiting.qsize()} of {len(mutants)} mutants to run, map of commit {known.commit[:12]}", flush=True)
    if waiting.qsize():
        _run_all(waiting, results, options.processes)
    report = describe(seed, mutants, results.by_id, read_equivalents())
    (FOLDER / f"report-{seed}.md").write_text(report)
    print(report)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, help="what the draw depends on (default: a new one, printed)")
    parser.add_argument("--number", type=int, default=150, help="mutants of each group (default: 150)")
    parser.add_argument("--group", action="append", choices=list(GROUPS), help="only this group; may be repeated")
    parser.add_argument("--processes", type=int, default=2, help="processes that run tests (default: 2)")
    parser.add_argument("--keep-map", action="store_true", help="use the map as it is, even of an older commit")
    return parser.parse_args()


def _run_all(waiting: queue.SimpleQueue[tuple[Mutant, list[str]]], results: _Results, processes: int) -> None:
    with contextlib.ExitStack() as stack:
        slots = [stack.enter_context(_slot(number)) for number in range(processes)]
        passes = _Baseline(FOLDER / "baseline.json")
        threads = [threading.Thread(target=_serve, args=(slot, waiting, results, passes)) for slot in slots]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()


def _serve(
    slot: Slot, waiting: queue.SimpleQueue[tuple[Mutant, list[str]]], results: _Results, passes: _Baseline
) -> None:
    while True:
        try:
            mutant, tests = waiting.get_nowait()
        except queue.Empty:
            return
        results.add(mutant, tests, _judge(slot, mutant, tests, passes))


def _judge(slot: Slot, mutant: Mutant, tests: list[str], passes: _Baseline) -> dict[str, Any]:
    """Run a mutant; a kill counts only if the test that killed it passes without the mutant."""
    seconds = 0.0
    while tests:
        answer = slot.ask(mutant, tests)
        seconds += answer["seconds"]
        if answer["verdict"] == "survived":
            break
        # A hang or a failed import names no test: then all of them have to pass without it.
        suspects = [answer["by"]] if answer["by"] in tests else tests
        if passes.known(suspects) or slot.ask(None, suspects)["verdict"] == "survived":
            passes.add(suspects)
            return answer | {"seconds": seconds}
        tests = [test for test in tests if test not in suspects] if len(suspects) == 1 else tests[: len(tests) // 2]
    return {"verdict": "survived", "by": None, "seconds": seconds}


class Slot:
    """The other end of a warm process (`tests.mutants.slot`)."""

    def __init__(self, process: subprocess.Popen[str], limit: float = LIMIT_S) -> None:
        self._process = process
        self._limit = limit

    def ask(self, mutant: Mutant | None, tests: list[str]) -> dict[str, Any]:
        """Run tests against a mutant, or against the product as it is."""
        path = mutant.mutation.path if mutant else None
        source = mutant.mutated.decode() if mutant else None
        request = {"path": path, "source": source, "tests": tests, "limit": self._limit}
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())


@contextlib.contextmanager
def _slot(number: int) -> Iterator[Slot]:
    """A warm process in a copy of the checkout, with a Postgres and a Valkey of its own."""
    tree = FOLDER / f"tree-{number}"
    _copy_checkout(tree)
    scratch = Path(tempfile.mkdtemp(prefix="mutants-"))
    folders = [tree, *(tree / name for name in ("shared", "workers", "services", "migrations"))]
    try:
        with start_postgres(scratch / "s", durable=False) as postgres, start_valkey(scratch / "s") as valkey:
            environment = {
                **os.environ,
                "MAREY_DATA": os.environ.get("MAREY_DATA", str(ROOT.parent / "shared" / "data")),
                "MAREY_MUTANTS_SCRATCH": str(scratch),
                "MAREY_TEST_POSTGRES": postgres.url,
                "MAREY_TEST_REDIS": valkey.url,
                "OMP_NUM_THREADS": "1",
                "PYTHONPATH": os.pathsep.join(map(str, folders)),
            }
            command = [sys.executable, "-m", "tests.mutants.slot", *PRELOADED]
            with (FOLDER / f"slot-{number}.log").open("w") as log:
                process = subprocess.Popen(
                    command,
                    cwd=tree,
                    env=environment,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    text=True,
                )
                try:
                    yield Slot(process)
                finally:
                    assert process.stdin is not None
                    process.stdin.close()
                    process.wait(10)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _copy_checkout(tree: Path) -> None:
    shutil.rmtree(tree, ignore_errors=True)
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listing, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)


class _Results:
    """Verdicts of a seed, a JSON line each as soon as it is known."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._started = time.monotonic()
        self._count = 0
        lines = path.read_text().splitlines() if path.is_file() else []
        self.by_id: dict[str, dict[str, Any]] = {line["id"]: line for line in map(json.loads, lines)}

    def holds(self, mutant: Mutant, tests: list[str]) -> bool:
        """Return True if the mutant was killed, or survived the same tests."""
        known = self.by_id.get(mutant.id)
        return known is not None and (known["verdict"] in KILLS or known["stamp"] == _stamp(tests))

    def add(self, mutant: Mutant, tests: list[str], verdict: dict[str, Any]) -> None:
        """Keep and print a verdict."""
        line = {"id": mutant.id, "group": mutant.group, "tests": len(tests), "stamp": _stamp(tests), **verdict}
        with self._lock:
            self._count += 1
            self.by_id[mutant.id] = line
            with self._path.open("a") as file:
                file.write(json.dumps(line) + "\n")
            minutes = (time.monotonic() - self._started) / 60
            place = f"{mutant.mutation.path}:{mutant.mutation.line}"
            print(f"{self._count:4} {minutes:5.1f} min  {verdict['verdict']:9} {verdict['seconds']:6.1f} s  {place}")
            sys.stdout.flush()


class _Baseline:
    """Tests that pass in a slot without a mutant, kept for as long as the tests and the product are the same."""

    def __init__(self, path: Path, root: Path = ROOT) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._state = _state_of_the_checkout(root)
        record = json.loads(path.read_text()) if path.is_file() else {}
        self._passes: set[str] = set(record["passes"]) if record.get("state") == self._state else set()

    def known(self, tests: list[str]) -> bool:
        """Return True if all of the tests are known to pass."""
        with self._lock:
            return self._passes.issuperset(tests)

    def add(self, tests: list[str]) -> None:
        """Note that tests pass."""
        with self._lock:
            if not self._passes.issuperset(tests):
                self._passes.update(tests)
                self._path.write_text(json.dumps({"state": self._state, "passes": sorted(self._passes)}))


def _state_of_the_checkout(root: Path) -> str:
    parts = [("rev-parse", "HEAD"), ("diff", "HEAD")]
    output = [subprocess.run(["git", *part], cwd=root, check=True, capture_output=True).stdout for part in parts]
    return hashlib.sha256(b"\n".join(output)).hexdigest()


def _stamp(tests: list[str]) -> str:
    return hashlib.sha256("\n".join(tests).encode()).hexdigest()[:16]


if __name__ == "__main__":
    main()
