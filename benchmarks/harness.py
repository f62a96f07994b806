"""Measurement harness: warm-up, repeats in turns, median, and a ratio to a baseline of the same run.

Machines differ and are shared; a ratio between two functions measured in turns in one process means more than either
time. A benchmark is a file `bench_NAME.py` with a `main()`; `python -m benchmarks NAME` runs it.
"""

from __future__ import annotations

import platform
import resource
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Seconds a call: median and quartiles over the repeats."""

    name: str
    median: float
    low: float
    high: float
    repeats: int


def measure(
    functions: Mapping[str, Callable[[], object]], *, repeats: int = 15, warm_up: int = 2, seconds: float = 10.0
) -> list[Timing]:
    """Time several functions in turns.

    Args:
        functions: by name; each call is one repeat.
        repeats: calls of each after the warm-up.
        warm_up: calls of each that are thrown away.
        seconds: stop repeating (after at least three) when all together took this long.
    """
    for function in functions.values():
        for _ in range(warm_up):
            function()
    times: dict[str, list[float]] = {name: [] for name in functions}
    begin = time.perf_counter()
    for done in range(repeats):
        if done >= 3 and time.perf_counter() - begin > seconds:
            break
        for name, function in functions.items():
            start = time.perf_counter()
            function()
            times[name].append(time.perf_counter() - start)
    return [_timing(name, taken) for name, taken in times.items()]


def _timing(name: str, taken: list[float]) -> Timing:
    low, median, high = statistics.quantiles(taken, n=4) if len(taken) > 1 else (taken[0],) * 3
    return Timing(name, median, low, high, len(taken))


def table(title: str, timings: list[Timing], *, baseline: str | None = None, note: str = "") -> str:
    """A Markdown table; the last column is how many times as fast as the baseline each is."""
    base = next((t.median for t in timings if t.name == baseline), None)
    lines = [f"{title} ({platform.machine()}, Python {platform.python_version()})", ""]
    lines += ["| what | median | quartiles | repeats | speed |", "|---|---|---|---|---|"]
    for t in timings:
        speed = f"{base / t.median:.2f} x" if base else ""
        lines.append(
            f"| {t.name} | {_unit(t.median)} | {_unit(t.low)} … {_unit(t.high)} | {t.repeats} | {speed} |",
        )
    return "\n".join([*lines, *(["", note] if note else []), ""])


def has_cuda() -> bool:
    """Print the CUDA device, or that there is none, and return True where there is one."""
    import torch

    if not torch.cuda.is_available():
        print("There is no CUDA device here: nothing is measured.\n")
        return False
    print(f"{torch.cuda.get_device_name()}, torch {torch.__version__}, CUDA {torch.version.cuda}\n")
    return True


def matrix_products() -> tuple[float, float]:
    """GFLOP/s of a large matrix product now, float32 and bfloat16, on torch's threads: what a machine could give."""
    import torch

    found = []
    for dtype in (torch.float32, torch.bfloat16):
        a, b = torch.randn(2048, 1024).to(dtype), torch.randn(1024, 1024).to(dtype)
        a @ b
        start = time.perf_counter()
        for _ in range(10):
            a @ b
        found.append(10 * 2 * 2048 * 1024 * 1024 / (time.perf_counter() - start) / 1e9)
    return found[0], found[1]


def processor_seconds(run: Callable[[], object]) -> float:
    """Processor time of one call, all threads: hardly changed by what else runs on the machine."""
    start = time.process_time()
    run()
    return time.process_time() - start


def peak_mib() -> float:
    """Most memory that this process has had, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _unit(seconds: float) -> str:
    for factor, unit in ((1, "s"), (1e3, "ms"), (1e6, "µs")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
