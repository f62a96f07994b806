"""Names of written files: `{index:05}_{name or slug}_{seed}.{ext}`, and never a path that leaves its folder."""

from __future__ import annotations

import re
import string
import unicodedata
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from shared.errors import InvalidInput
from shared.items import NAME, RESERVED

DEFAULT_TEMPLATE = "{index:05}_{name}_{seed}"
MAX_SLUG = 48
FIELDS = ("index", "name", "seed", "variant", "model", "job", "tags")
TAG = re.compile(r"tag\[[\w-]{1,64}\]")
"""`{tag[shot]}` is `010` where the item has the tag `shot=010`."""


@dataclass(frozen=True)
class Naming:
    """What a template may speak of. `index` counts prompts from 0; `name` is the item's name, else a slug."""

    index: int
    name: str
    seed: int
    variant: int
    model: str
    job: str
    tags: Sequence[str] = ()


class _Values(dict[str, str]):
    """Values of tags such as `shot=010`, by their key."""

    def __missing__(self, key: str) -> str:
        raise InvalidInput(
            f"an item has no tag {key}=…, which the file names want", where="--name-template", hint=_HINT
        )


class _AnyValue(dict[str, str]):
    """While a template is looked at, every tag has a value."""

    def __missing__(self, _: str) -> str:
        return "tag"


def slug(text: str, limit: int = MAX_SLUG) -> str:
    """The words of a prompt as a plain file name: `A person waves!` → `a-person-waves`."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    words = re.sub(r"[^a-z0-9]+", "-", plain).strip("-")
    if len(words) > limit:
        words = words[: limit + 1].rpartition("-")[0] or words[:limit]
    return words or "motion"


def check_template(template: str) -> str:
    """The template, if it makes one plain file name from each item.

    Raises:
        InvalidInput: it names an unknown field, or could leave the folder.
    """
    try:
        fields = [name for _, name, _, _ in string.Formatter().parse(template) if name is not None]
    except ValueError as error:
        raise InvalidInput(f"{template!r} is not a template: {error}", where="--name-template", hint=_HINT) from error
    unknown = [name for name in fields if name not in FIELDS and not TAG.fullmatch(name)]
    if unknown:
        raise InvalidInput(f"{unknown[0]!r} is not a field of a template", where="--name-template", hint=_HINT)
    _file_name(template, Naming(1, "name", 0, 0, "hgm3", "job"), "npz", _AnyValue())
    return template


def file_name(template: str, naming: Naming, extension: str) -> str:
    """The file name of one motion.

    Raises:
        InvalidInput: what comes out is not a plain file name, or the item lacks a tag.
    """
    return _file_name(template, naming, extension, _Values(values_of(naming.tags)))


class FileNames:
    """File names of one run, of which no two motions have the same."""

    def __init__(self, template: str) -> None:
        self._template = template
        self._owners: dict[str, Hashable] = {}

    def of(self, motion: Hashable, naming: Naming, extension: str) -> str:
        """The file name of a motion, which is told from the others by `motion`.

        Raises:
            InvalidInput: as `file_name`; or another motion has it, also where systems do not tell cases apart.
        """
        name = file_name(self._template, naming, extension)
        if self._owners.setdefault(name.casefold(), motion) != motion:
            raise InvalidInput(
                f"two motions would be written to {name}", where="--name-template", hint="Put {index} and {seed} in."
            )
        return name


def values_of(tags: Sequence[str]) -> dict[str, str]:
    """What tags such as `shot=010` say, by their key; the first of a key counts."""
    pairs = (tag.partition("=") for tag in reversed(tags) if "=" in tag)
    return {key.strip(): value.strip() for key, _, value in pairs}


def _file_name(template: str, naming: Naming, extension: str, values: dict[str, str]) -> str:
    try:
        stem = template.format(**{**vars(naming), "tags": "_".join(naming.tags), "tag": values})
    except (ValueError, TypeError) as error:
        raise InvalidInput(f"{template!r} is not a template: {error}", where="--name-template", hint=_HINT) from error
    if not NAME.match(stem) or "/" in stem or "\\" in stem or ".." in stem or not stem.isprintable():
        raise InvalidInput(f"{stem!r} is not a plain file name", where="--name-template", hint=_HINT)
    if len(stem) > 200 or RESERVED.fullmatch(stem) or set(stem) & set('<>:"|?*'):
        raise InvalidInput(f"{stem[:80]!r} is not a file name on every system", where="--name-template", hint=_HINT)
    return f"{stem}.{extension}"


_HINT = (
    f"Fields are {', '.join('{' + f + '}' for f in FIELDS)} and {{tag[shot]}} for the value of a tag shot=…; "
    f"the default is {DEFAULT_TEMPLATE!r}. No folders in it."
)
