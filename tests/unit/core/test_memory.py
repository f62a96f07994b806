"""The limit of memory of a process."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import mmap
from marey.core.memory import limit_memory
held = bytearray(2**26)
limit_memory({size}, more={more})
reserved = mmap.mmap(-1, 2**31, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, 0)
bytearray(2**25)
try:
    bytearray(2**28)
except MemoryError:
    print("refused")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such limit")
@pytest.mark.parametrize(("size", "more"), [(2**28, False), (2**27, True)])
def test_memory_is_bound_and_address_space_is_not(size, more):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(size=size, more=more)], capture_output=True, text=True, check=True
    )
    assert done.stdout == "refused\n"
