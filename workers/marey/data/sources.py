"""Sources of training data: terms, credit, and splits for sources without their own."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """An archive that can be prepared; its terms travel into every manifest and model card."""

    name: str
    title: str
    licence: str
    credit: str
    url: str


SOURCES: dict[str, Source] = {
    source.name: source
    for source in (
        Source(
            "bandai-namco",
            "Bandai-Namco Research Motion Dataset 1 and 2",
            "CC BY-NC 4.0",
            "Kobayashi et al., Motion Capture Dataset for Practical Use of AI-based Motion Editing and Stylization, "
            "2023, arXiv 2306.08861; Bandai Namco Research Inc.",
            "https://github.com/BandaiNamcoResearchInc/Bandai-Namco-Research-Motiondataset",
        ),
        Source(
            "cmu",
            "CMU Graphics Lab Motion Capture Database, iClone rig",
            "free for all uses",
            "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding "
            "from NSF EIA-0196217.",
            "http://mocap.cs.cmu.edu",
        ),
    )
}


def cmu_split(name: str) -> str:
    """Split of a CMU trial by the hash of its name: about 80 % train, 5 % val, 15 % test."""
    share = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4]) / 2**32
    return "train" if share < 0.8 else "val" if share < 0.85 else "test"
