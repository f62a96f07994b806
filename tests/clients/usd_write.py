"""Write a USD file from an npz of Marey, in a Python that has `usd-core` and numpy but not Marey itself.

    python usd_write.py SHARED IN.npz OUT.usd OPTIONS

SHARED is the folder of the package `marey` in the checkout, OPTIONS a JSON object of `Coordinates`.
"""

import json
import sys
from pathlib import Path

shared, source, target, options = sys.argv[1:]
sys.path.insert(0, shared)

from marey.exporters import Coordinates  # noqa: E402
from marey.exporters.usd import EXPORTER  # noqa: E402
from marey.motion.clip import load_npz  # noqa: E402

clip, coordinates = load_npz(source), Coordinates(**json.loads(options))
data = EXPORTER.write(clip, coordinates)
assert data == EXPORTER.write(clip, coordinates), "equal clips give equal bytes"
Path(target).write_bytes(data)
