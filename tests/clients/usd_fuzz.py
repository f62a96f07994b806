"""Read damaged USD files, in a Python that has `usd-core` and numpy but not Marey itself.

    python usd_fuzz.py REPOSITORY COUNT SEED

Each is read in a fork with the limits of `marey.motion.io.usd_child`: it answers, or Pixar's library ends the process,
which the reader tells as a broken file. Two seconds of processor time and 256 MiB are all that it gets. Every hundredth
goes through the reader itself. Prints how many files were read and refused, and how often the library failed.
"""

import importlib
import json
import os
import signal
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random

repository, count, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
sys.path[:0] = [repository, f"{repository}/shared"]

from marey.core.errors import InvalidFile, TooLarge  # noqa: E402
from marey.motion.io import usd_child  # noqa: E402
from marey.motion.io.rig_usd import parse_usd_rig  # noqa: E402
from tests.support.damage import damaged, damaged_text  # noqa: E402
from tests.support.usd import prim, usda  # noqa: E402

modules = {name: importlib.import_module(f"pxr.{name}") for name in usd_child.MODULES}
modules["Work"].SetConcurrencyLimit(1)
text = usda(beside=prim('def Mesh "Body"', "point3f[] points = [(0, 1, 2)]", "asset map = @@")).encode()
folder = Path(tempfile.mkdtemp())
layer = modules["Sdf"].Layer.CreateAnonymous(".usda")
layer.ImportFromString(text.decode())
layer.Export(str(folder / "a.usdc"))
files = {"text": (text, damaged_text), "binary": ((folder / "a.usdc").read_bytes(), damaged)}


def read_in_fork(path):
    """Verdict of a fork on a file: `read`, `refused` or `failed`; None where it says nothing of these."""
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        status = 3
        with suppress(BaseException):
            usd_child.limit(2, 2**28)
            status = 1 if "error" in usd_child.answer(modules, str(path)) else 0
        os._exit(status)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return {0: "read", 1: "refused", -signal.SIGSEGV: "failed", -signal.SIGABRT: "failed"}.get(code, f"code {code}")


seen = Counter()
for number in range(count):
    name = list(files)[number % 2]
    data = files[name][1](files[name][0], Random(f"{name} {seed} {number}"))
    path = folder / "rig.usd"
    path.write_bytes(data)
    found = read_in_fork(path)
    assert found in ("read", "refused", "failed"), f"{name}, seed {seed}, number {number}: {found}"
    seen[found] += 1
    if number % 100 < 2:
        with suppress(InvalidFile, TooLarge):
            parse_usd_rig(data, "a.usd")
print(json.dumps(seen))
