"""Write USD files of the npz files of a folder, in a Python that has `usd-core` and numpy but not Marey itself.

    python usd_write.py SHARED FOLDER OPTIONS

SHARED is the folder of the package `marey` in the checkout, OPTIONS a JSON object: the options of `Coordinates` by the
stem of each npz. Beside `a.npz`, `a.usd` is written.
"""

import json
import sys
from pathlib import Path

shared, folder, options = sys.argv[1:]
sys.path.insert(0, shared)

from marey.exporters import Coordinates  # noqa: E402
from marey.exporters.usd import EXPORTER  # noqa: E402
from marey.motion.clip import load_npz  # noqa: E402

for stem, chosen in json.loads(options).items():
    source = Path(folder) / f"{stem}.npz"
    clip, coordinates = load_npz(source), Coordinates(**chosen)
    data = EXPORTER.write(clip, coordinates)
    assert data == EXPORTER.write(clip, coordinates), "equal clips give equal bytes"
    source.with_suffix(".usd").write_bytes(data)
