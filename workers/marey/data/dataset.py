"""`dataset.toml`: the description of a set of captures. No set needs its own code.

It names the set and its terms, maps the columns of its `index.csv`, and describes its rigs. Descriptions of the known
sets are in `sets/`; a studio writes its own.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile, NotFound
from marey.core.validation import first_problem
from marey.data.licences import Terms, Tier
from marey.data.rigs import CapturedRig
from marey.motion.units import Unit, Up

DATASET, INDEX = "dataset.toml", "index.csv"
MAX_BYTES = 2**20
SETS = Path(__file__).with_name("sets")


class Dataset(BaseModel):
    """A set of captures.

    Attributes:
        name: short name; ids of clips are unique within the set.
        title, url: for the manifest and the model card.
        licence, credit, tier: terms of the set; a row of the index may have its own.
        unit, up: unit of lengths in the files, and the axis that points up.
        floor: position of the floor: `support`: level, and under the parts of the body that carry it; `feet`: under the
            feet; `file`: at height 0 of the file.
        largest_error_cm: clips with a larger `error_cm` are left out.
        index_fps: frames a second at which the index counts `start` and `end`; 1 counts seconds.
        columns: template of each Marey column from columns of the index, such as `{actor} {class}`.
        rigs: one per kind of skeleton; the first that fits a file is used.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_.-]*$")
    title: str
    url: str = ""
    licence: str
    credit: str
    tier: Tier
    unit: Unit = "cm"
    up: Up = "y"
    floor: Literal["support", "feet", "file"] = "support"
    largest_error_cm: float = 2.0
    index_fps: float = Field(default=30.0, gt=0)
    columns: Mapping[str, str] = {}
    rigs: tuple[CapturedRig, ...] = Field(alias="rig", min_length=1)

    @property
    def terms(self) -> Terms:
        """Terms of the clips, except for rows with their own."""
        return Terms(self.name, self.title, self.licence, self.credit, self.url, self.tier)

    def rig_of(self, names: tuple[str, ...], where: str) -> CapturedRig:
        """Find the rig of a skeleton by its joint names.

        Raises:
            InvalidFile: no rig fits; the message names the first missing joint of the first rig.
        """
        have = frozenset(names)
        for rig in self.rigs:
            if rig.fits(have):
                return rig
        missing = next(name for name in self.rigs[0].joint_names if name not in have)
        raise InvalidFile(
            f"no joint {missing!r}: this is not the {self.rigs[0].name} rig",
            where=where,
            hint="Describe this rig under [[rig]] of dataset.toml.",
        )


def read_dataset(path: Path) -> Dataset:
    """Read a `dataset.toml`.

    Raises:
        NotFound: no such file.
        InvalidFile: not TOML, or an invalid field, which the message names.
    """
    where = str(path)
    try:
        table: dict[str, Any] = tomllib.loads(read_bytes(path, limit=MAX_BYTES).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InvalidFile(f"is not TOML: {error}", where=where) from None
    try:
        return Dataset.model_validate(table)
    except ValidationError as error:
        raise InvalidFile(first_problem(error), where=where) from None


def known_sets() -> tuple[str, ...]:
    """Names of the sets described in this package."""
    return tuple(sorted(path.parent.name for path in SETS.glob(f"*/{DATASET}")))


def known_set(name: str) -> Dataset:
    """Description of a known set.

    Raises:
        NotFound: no such set.
    """
    if name not in known_sets():
        raise NotFound(f"there is no set {name!r}", hint=f"Known: {', '.join(known_sets())}.")
    return read_dataset(SETS / name / DATASET)
