"""Paths of written files: `{index:05}_{name or slug}_{seed}.{ext}`, in sub-folders if the template has them.

A name may be any text; the path that is derived from it is one that every file system takes, and never leads out of its
folder. Names of ASCII letters, digits and `_ .()+=@,-` stand in it as they are.
"""

from __future__ import annotations

import re
import string
import unicodedata
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

from marey.core.characters import MARKS, is_printable
from marey.core.errors import InvalidInput
from marey.items.values import RESERVED

DEFAULT_TEMPLATE = "{index:05}_{name}_{seed}"
MAX_SLUG = 48
MAX_BYTES = 240
"""Of a name without its ending, in UTF-8. File systems take 255, of which `.npz` and, while a file comes, `.part` are
nine."""
MAX_FOLDERS = 8
FIELDS = ("index", "name", "prompt", "seed", "variant", "model", "bundle", "job", "tags")
_TAG = re.compile(r"tag\[([\w -]{1,64})\]")
_LONG_NUMBER = re.compile(r"[0-9]{4}")
"""Of a format: `{index:9999}` would be a width."""
_UNSAFE = re.compile(r'[<>:"/\\|?*]')
"""Separators, and what Windows does not take."""


@dataclass(frozen=True)
class Naming:
    """The values of a template. `index` counts prompts from 0; `name` is the item's name, else a slug."""

    index: int
    name: str
    seed: int
    variant: int
    model: str
    job: str
    tags: Sequence[str] = ()
    bundle: str = ""
    prompt: str = ""
    """A slug of it."""


@dataclass(frozen=True)
class _Field:
    """A field of a template: one of `FIELDS`, or the value of the tag `key=…`."""

    name: str
    spec: str = ""
    key: str | None = None


_Component = tuple[str | _Field, ...]
"""Of a path: texts and fields, one after the other."""


def slug(text: str, limit: int = MAX_SLUG) -> str:
    """Return the words of a prompt as a plain file name: `A person waves!` → `a-person-waves`."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    words = re.sub(r"[^a-z0-9]+", "-", plain).strip("-")
    if len(words) > limit:
        words = words[: limit + 1].rpartition("-")[0] or words[:limit]
    return words or "motion"


def safe_component(text: str) -> str:
    """Return the text as a name that every file system accepts, with an extension or as a folder.

    Unicode is NFC; separators, control characters and what Windows does not take become `_`; a name of a device, a dot
    or a dash at the beginning gets `_` in front.
    """
    text = unicodedata.normalize("NFC", text)
    text = "".join(c if is_printable(c) else " " if unicodedata.category(c) == "Zs" else "_" for c in text)
    text = _UNSAFE.sub("_", re.sub("[\u200e\u200f]", "", text)).strip(" ").rstrip(". ")
    return f"_{text}" if not text or text[0] in ".-~" or RESERVED.fullmatch(text) else text


def check_template(template: str) -> str:
    """Check that a template makes a path inside its folder from each item, and return it.

    Raises:
        InvalidInput: it names an unknown field, or could leave the folder.
    """
    _path(_parse(template), template, Naming(1, "name", 0, 0, "hgm3", "job", (), "hgm3", "prompt"), None)
    return template


def file_name(template: str, naming: Naming, extension: str) -> str:
    """Return the path of a motion's file relative to its folder, with `/` between its parts.

    Raises:
        InvalidInput: the item lacks a tag, or the template is as in `check_template`.
    """
    return f"{_path(_parse(template), template, naming, values_of(naming.tags))}.{extension}"


class FileNames:
    """Paths of the files of one run, unique for each motion."""

    def __init__(self, template: str) -> None:
        self._template = template
        self._components = _parse(template)
        self._owners: dict[str, Hashable] = {}

    def of(self, motion: Hashable, naming: Naming, extension: str) -> str:
        """Return the path of a motion's file.

        Args:
            motion: identifies the motion.

        Raises:
            InvalidInput: as `file_name`; or another motion has the path, also on systems that ignore case.
        """
        stem = _path(self._components, self._template, naming, values_of(naming.tags))
        name = f"{stem}.{extension}"
        if self._owners.setdefault(_as_compared(name), motion) != motion:
            raise InvalidInput(
                f"two motions would be written to {name}",
                where="name_template",
                hint="Put {index} and {seed} in.",
                argument="name_template",
            )
        return name


def values_of(tags: Sequence[str]) -> dict[str, str]:
    """Return the values of tags such as `shot=010` by their key; the first of a key counts."""
    pairs = (tag.partition("=") for tag in reversed(tags) if "=" in tag)
    return {key.strip(): value.strip() for key, _, value in pairs}


def _as_compared(path: str) -> str:
    """Return the path as systems compare it that ignore case and Unicode normalisation."""
    return unicodedata.normalize("NFC", "".join(c for c in path if c not in MARKS).casefold())


def _parse(template: str) -> list[_Component]:
    """The components of a template's path.

    Raises:
        InvalidInput: it is not a template, names an unknown field, or leads out of the folder.
    """
    components: list[list[str | _Field]] = [[]]
    try:
        for literal, name, spec, conversion in string.Formatter().parse(template):
            first, *others = literal.split("/")
            components[-1].append(first)
            components.extend([other] for other in others)
            if name is not None:
                components[-1].append(_field(name, spec or "", conversion))
    except ValueError as error:
        raise _invalid(f"{template!r} is not a template: {error}") from error
    found: list[_Component] = [tuple(part for part in component if part) for component in components]
    if not all(found):
        raise _invalid(f"{template!r} is not a path inside the folder: it begins or ends with / or has two of them")
    if len(found) > MAX_FOLDERS + 1:
        raise _invalid(f"{template!r} has more than {MAX_FOLDERS} folders")
    return found


def _field(name: str, spec: str, conversion: str | None) -> _Field:
    if conversion:
        raise _invalid(f"{name + '!' + conversion!r} is not a field of a template")
    tag = _TAG.fullmatch(name)
    if tag or (name == "tag" and spec):
        return _Field("tag", spec if tag else "", tag[1] if tag else spec.strip())
    if name not in FIELDS:
        raise _invalid(f"{name!r} is not a field of a template")
    if "{" in spec or _LONG_NUMBER.search(spec):
        raise _invalid(f"{spec!r} is not a format of a template")
    return _Field(name, spec)


def _path(components: Sequence[_Component], template: str, naming: Naming, tags: Mapping[str, str] | None) -> str:
    """The path without its ending.

    Args:
        tags: values by key; None = check the template itself: every tag has a value, and only values may be unsafe.
    """
    made: list[str] = []
    for component in components:
        texts: list[str] = []
        cuttable: list[int] = []
        for part in component:
            if isinstance(part, _Field):
                cuttable.append(len(texts))
                texts.append(_formatted(part, template, naming, tags))
            else:
                texts.append(part)
        written = "".join(texts)
        safe = safe_component(_fitted(texts, cuttable))
        if tags is None and safe != unicodedata.normalize("NFC", written):
            raise _invalid(f"{written!r} is not a plain file name")
        made.append(safe)
    return "/".join(made)


def _formatted(field: _Field, template: str, naming: Naming, tags: Mapping[str, str] | None) -> str:
    if field.key is not None:
        value: object = "tag" if tags is None else tags.get(field.key)
        if value is None:
            raise _invalid(f"an item has no tag {field.key}=…, which the file names want")
    elif field.name == "tags":
        value = "_".join(naming.tags)
    else:
        value = getattr(naming, field.name)
    try:
        return format(value, field.spec)
    except ValueError as error:
        raise _invalid(f"{template!r} is not a template: {error}") from error


def _fitted(texts: list[str], cuttable: Sequence[int]) -> str:
    """Join texts, and shorten the longest of the cuttable ones until the result fits into `MAX_BYTES`.

    Raises:
        InvalidInput: it cannot fit.
    """
    texts = [unicodedata.normalize("NFC", text) for text in texts]
    while (over := len("".join(texts).encode("utf-8", "replace")) - MAX_BYTES) > 0:
        longest = max(cuttable, key=lambda i: len(texts[i].encode("utf-8", "replace")), default=None)
        size = 0 if longest is None else len(texts[longest].encode("utf-8", "replace"))
        if longest is None or size < 2:
            raise _invalid(f"{''.join(texts)[:80]!r}… is longer than a file name may be")
        kept = texts[longest].encode("utf-8", "replace")[: max(size - over, 1)].decode("utf-8", "ignore")
        texts[longest] = kept.rstrip(f" .{MARKS}")
    return "".join(texts)


def _invalid(message: str) -> InvalidInput:
    return InvalidInput(message, where="name_template", hint=_HINT, argument="name_template")


_HINT = (
    f"Fields are {', '.join('{' + f + '}' for f in FIELDS)} and {{tag:shot}} for the value of a tag shot=…; / makes "
    f"folders; the default is {DEFAULT_TEMPLATE!r}."
)
