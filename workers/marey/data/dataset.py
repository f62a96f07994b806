"""`dataset.toml`: the description of a set of captures. No set has code of its own.

It names the set with its terms, maps the columns of its `index.csv`, and describes its rigs. Those of the known sets
are in `sets/`; a studio writes its own.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile, NotFound
from marey.data.licences import Terms, Tier
from marey.data.rigs import Rig
from marey.motion.units import Unit, Up

DATASET, INDEX = "dataset.toml", "index.csv"
MAX_BYTES = 2**20
SETS = Path(__file__).with_name("sets")


class Dataset(BaseModel):
    """A set of captures.

    Attributes:
        name: short name; a clip's id is unique within it.
        title, url: for the manifest and the model card.
        licence, credit, tier: its terms; a row of the index may have its own.
        unit, up: of the files' lengths, and the axis that points up.
        floor: where a clip's floor is: `support`: level, and under whatever part of the body supports it; `feet`: under
            the feet; `file`: at height 0 of the file.
        largest_error_cm: clips with a larger `error_cm` are left out.
        index_fps: frames a second at which the index counts `start` and `end`; 1 counts seconds.
        columns: how each of our columns is made of those of the index: a template such as `{actor} {class}`.
        rigs: one a kind of skeleton; the first that fits a file is taken.
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
    rigs: tuple[Rig, ...] = Field(alias="rig", min_length=1)

    @property
    def terms(self) -> Terms:
        """Terms of its clips, but for rows with their own."""
        return Terms(self.name, self.title, self.licence, self.credit, self.url, self.tier)

    def rig_of(self, names: tuple[str, ...], where: str) -> Rig:
        """The rig of a skeleton with joints of these names.

        Raises:
            InvalidFile: none fits; the message names the joint that the first one misses.
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
        InvalidFile: not TOML, or not a description of a set, with the field.
    """
    where = str(path)
    try:
        table: dict[str, Any] = tomllib.loads(read_bytes(path, limit=MAX_BYTES).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidFile(f"is not TOML: {error}", where=where) from None
    try:
        return Dataset.model_validate(table)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(map(str, first["loc"])) or "the table"
        raise InvalidFile(f"{field}: {first['msg']}", where=where) from None


def known_sets() -> tuple[str, ...]:
    """Names of the sets that are described here."""
    return tuple(sorted(path.parent.name for path in SETS.glob(f"*/{DATASET}")))


def known_set(name: str) -> Dataset:
    """Description of a known set.

    Raises:
        NotFound: no such set.
    """
    if name not in known_sets():
        raise NotFound(f"there is no set {name!r}", hint=f"Known: {', '.join(known_sets())}.")
    return read_dataset(SETS / name / DATASET)
