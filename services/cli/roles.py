"""What the workers of this product are; the only module of `services` that imports `workers`, and only when asked."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from shared.errors import InvalidInput, NotFound

if TYPE_CHECKING:
    from shared.bundles import Bundle
    from shared.motion.clip import MotionClip
    from shared.nn.motion_tokenizer import MotionTokenizer
    from shared.runtime.handler import Role
    from shared.settings import Settings
    from workers.generating.port import Generator
    from workers.training.data.pack import JointsPack

HANDLERS = {
    "hgm3": "workers.hgm3.handler:create_handler",
    "mogo": "workers.mogo.handler:create_handler",
    "text": "services.text.handler:create_handler",
    "evaluator": "workers.evaluator.handler:create_handler",
}
"""Factories by queue, as strings: only a worker's child imports them, and with them torch."""
SHOWS = {"mogo": "workers.mogo.live:create_show"}
"""What the live loop of each model that streams serves."""
GENERATORS = {"hgm3": "workers.hgm3.generate", "mogo": "workers.mogo.generate"}
"""Where each model's `Generator` is."""


def default_roles(config: Settings) -> str:
    """One child for every model that has a bundle here, for prompts, and for evaluations where there is an evaluator:
    two would fight for the cores."""
    from shared.bundles import list_bundles

    here = {bundle.manifest.model for bundle in list_bundles(config=config, kind="generator")}
    judges = ["evaluator" for _ in list_bundles(config=config, kind="evaluator")][:1]
    return "+".join([*([model for model in GENERATORS if model in here] or ["hgm3"]), "text", *judges])


def parse_roles(text: str) -> list[tuple[str, ...]]:
    """`hgm3+text,hgm3` → one worker of both queues and one of the first.

    Raises:
        InvalidInput: an unknown queue.
    """
    roles = [tuple(part.strip() for part in role.split("+")) for role in text.split(",")]
    for name in (name for role in roles for name in role):
        if name not in HANDLERS:
            raise InvalidInput(
                f"there is no worker {name!r}",
                where="--with",
                hint=f"Known: {', '.join(HANDLERS)}; + joins them in one child, a comma separates children.",
            )
    return roles


def role_of(queues: Sequence[str], config: Settings) -> Role:
    """The role of a worker that serves these queues, its model loaded before it is ready.

    Raises:
        NotFound, InvalidBundle: there is no bundle for its model, or a broken one.
    """
    from shared.bundles import choose_bundle
    from shared.runtime.handler import Role

    preload = {q: choose_bundle(q, config=config).reference for q in queues if q in GENERATORS}
    return Role("+".join(queues), {queue: HANDLERS[queue] for queue in queues}, preload)


def threads_of(config: Settings, torch_children: int) -> int:
    """Torch threads of one child: the cores, divided by the children that compute."""
    return config.threads or max(1, len(os.sched_getaffinity(0)) // max(1, torch_children))


@dataclass(frozen=True)
class Wanted:
    """One motion to make without a server."""

    prompt: str
    seed: int
    seconds: float | None
    settings: Mapping[str, float]


class OneShot:
    """A model in this process: what `marey generate` runs."""

    def __init__(self, bundle: Bundle, config: Settings) -> None:
        """Load the bundle and what reads its prompts.

        Raises:
            InvalidInput: the extra `worker` is not installed, or there is no such device.
            NotFound, InvalidBundle: weights are missing or damaged.
        """
        try:
            from shared.text.keys import as_served
            from shared.text.pipeline import TextPipeline

            kind = import_module(GENERATORS[bundle.manifest.model]).Generator
        except ImportError as error:
            raise needs_extra("worker", error) from error
        if bundle.manifest.text is None:
            raise InvalidInput(f"{bundle.manifest.name!r} does not read prompts", where=str(bundle.path))
        self.bundle = bundle
        self._text = TextPipeline.load(as_served(bundle.manifest.text, config=config))
        self._generator: Generator[Any] = kind.load(bundle, device=config.device, threads=threads_of(config, 1))

    def make(self, wanted: Sequence[Wanted]) -> Iterator[tuple[Wanted, MotionClip, float]]:
        """Each motion with the seconds it took, in the order given.

        Raises:
            InvalidInput: a length this bundle cannot make; before anything is made.
        """
        from workers.generating.export import finish, split_settings
        from workers.generating.port import Request

        features = self._text.features([w.prompt for w in wanted])
        fps = self._generator.limits.fps
        requests = [
            Request(text, w.seed, None if w.seconds is None else round(w.seconds * fps))
            for w, text in zip(wanted, features, strict=True)
        ]
        requests = [self._generator.settled(request) for request in requests]
        start = 0
        for _, group in groupby(wanted, key=lambda w: sorted(w.settings.items())):
            rows = list(group)
            values, output_fps = split_settings(rows[0].settings)
            settings, size = self._generator.settings(values), self._generator.batch
            for low in range(0, len(rows), size):
                batch = requests[start + low : start + min(low + size, len(rows))]
                began = time.monotonic()
                made = self._generator.generate(batch, settings)
                elapsed = (time.monotonic() - began) / len(batch)
                for row, request, generated in zip(rows[low:], batch, made, strict=False):
                    assert generated is not None  # nothing was dropped
                    yield row, finish(self._generator, request, generated, settings, fps=output_fps), elapsed
            start += len(rows)


def make_random_bundle(path: Path) -> None:
    """A tiny HGM³ with random weights: it exercises everything and generates nonsense."""
    from workers.hgm3.bundle import random_bundle

    random_bundle(path)


@dataclass(frozen=True)
class CaptureSources:
    """What `marey data pack` and `prepare` read.

    Attributes:
        named: source (`bandai-namco`, `cmu` or `pack`) and its archive, folder or file.
        splits: of bandai-namco; None = beside the archive.
        captions: of cmu; None = beside the archive.
        processes: how many retarget at once.
    """

    named: Sequence[tuple[str, Path]]
    splits: Path | None = None
    captions: Path | None = None
    processes: int = 2


def read_captures(sources: CaptureSources, progress: Callable[[str, int, int | None], None]) -> list[JointsPack]:
    """The clips of each source on the 22-joint skeleton, at 20 fps.

    Raises:
        InvalidInput: an unknown source.
        NotFound, InvalidFile, TooLarge: from reading.
    """
    try:
        from workers.training.data.pack import JointsPack
        from workers.training.data.prepare import pack_bandai_namco, pack_cmu
    except ImportError as error:
        raise needs_extra("worker", error) from error
    options = {"processes": sources.processes}
    readers: dict[str, Callable[[Path], JointsPack]] = {
        "bandai-namco": lambda path: pack_bandai_namco(
            path, splits=sources.splits, progress=partial(progress, "bandai-namco"), **options
        ),
        "cmu": lambda path: pack_cmu(path, captions=sources.captions, progress=partial(progress, "cmu"), **options),
        "pack": JointsPack.load,
    }
    for name, _ in sources.named:
        if name not in readers:
            raise InvalidInput(f"there is no source {name!r}", hint=f"Known: {', '.join(readers)}.")
    return [readers[name](path) for name, path in sources.named]


def pack_data(sources: CaptureSources, output: Path, progress: Callable[[str, int, int | None], None]) -> list[Path]:
    """Write one joints pack a source into a folder: small enough to carry to the machine that trains.

    Raises:
        InvalidInput, NotFound, InvalidFile, TooLarge: see `read_captures`.
    """
    output.mkdir(parents=True, exist_ok=True)
    paths = [output / f"{name}.pack.npz" for name, _ in sources.named]
    for path, pack in zip(paths, read_captures(sources, progress), strict=True):
        pack.save(path)
    return paths


def prepare_data(sources: CaptureSources, output: Path, progress: Callable[[str, int, int | None], None]) -> str:
    """Prepare training data; a line that says what was made.

    Raises:
        InvalidInput, NotFound, InvalidFile, TooLarge: see `read_captures`.
        Conflict: the folder is in use.
    """
    packs = read_captures(sources, progress)
    from workers.training.data.build import build

    manifest = build(packs, output, progress=partial(progress, "building"))
    return ", ".join(f"{split} {count} clips" for split, count in manifest.splits.items())


def inspect_data(folder: Path, clip: str | None) -> dict[str, Any]:
    """What a prepared folder holds, its hashes checked; or one clip of it.

    Raises:
        NotFound, InvalidFile: no such folder or clip, or a changed file.
    """
    try:
        from workers.training.data.inspect import summarize
        from workers.training.data.prepared import PreparedData
    except ImportError as error:
        raise needs_extra("worker", error) from error
    data = PreparedData.open(folder)
    if clip is None:
        return summarize(data).model_dump(mode="json")
    for found in data.clips:
        if found.id == clip:
            return found.model_dump(mode="json")
    raise NotFound(f"there is no clip {clip!r}", where=str(folder), hint=f"The first is {data.clips[0].id}.")


def encode_captions(folder: Path, model: str | None, progress: Callable[[int, int], None]) -> int:
    """Write `texts.npz` of a prepared folder; how many captions it holds."""
    try:
        from shared.bundles import TextSpec, choose_bundle
        from shared.text.pipeline import TextPipeline
        from workers.training.data.prepared import PreparedData
        from workers.training.texts import CaptionTexts
    except ImportError as error:
        raise needs_extra("worker", error) from error
    spec = TextSpec() if model is None else choose_bundle(model).manifest.text
    if spec is None:
        raise InvalidInput(f"{model!r} does not read prompts", where="--model")
    data = PreparedData.open(folder)
    captions = [clip.captions + clip.act_captions for clip in data.clips]
    processes = os.cpu_count() or 1
    CaptionTexts.build(captions, TextPipeline.load(spec), processes=processes, progress=progress).save(folder)
    return sum(map(len, captions))


def train_stage(
    model: Literal["hgm3", "mogo", "evaluator"],
    name: str,
    data: Path,
    run: Path,
    *,
    config: str,
    steps: int | None,
    minutes: float | None,
    rate: float | None = None,
    mask: Literal["hard", "random"] | None = None,
    **options: Any,
) -> dict[str, float]:
    """Train one stage of a model; its metrics. See `workers.training.staging.TrainOptions` for the options."""
    try:
        from workers.evaluator import config as evaluator_config
        from workers.evaluator import train as evaluator
        from workers.hgm3 import config as hgm3_config
        from workers.hgm3 import train as hgm3
        from workers.mogo import config as mogo_config
        from workers.mogo import train as mogo
        from workers.training.budget import Budget
        from workers.training.optimisation import with_learning_rate
        from workers.training.staging import TrainOptions
    except ImportError as error:
        raise needs_extra("worker", error) from error
    budget = Budget(steps, minutes)
    if model == "hgm3":
        chosen = with_learning_rate(hgm3_config.named_config(config, mask=mask), name, rate)
        return hgm3.train_stage(name, TrainOptions(data, run, chosen, budget, **options))
    if model == "evaluator":
        judge = with_learning_rate(evaluator_config.named_config(config), name, rate)
        return evaluator.train_stage(name, TrainOptions(data, run, judge, budget, **options))
    mogos = with_learning_rate(mogo_config.named_config(config), name, rate)
    return mogo.train_stage(name, TrainOptions(data, run, mogos, budget, **options))


def assemble_bundle(
    model: Literal["hgm3", "mogo", "evaluator"],
    data: Path,
    run: Path,
    output: Path,
    *,
    config: str,
    card: Path | None,
    overwrite: bool,
    mask: Literal["hard", "random"] | None = None,
) -> str:
    """Write the bundle of a run; its exact reference."""
    try:
        from workers.evaluator import assembly as evaluator
        from workers.evaluator import config as evaluator_config
        from workers.hgm3 import assembly as hgm3
        from workers.hgm3 import config as hgm3_config
        from workers.mogo import assembly as mogo
        from workers.mogo import config as mogo_config
    except ImportError as error:
        raise needs_extra("worker", error) from error
    text = None if card is None else card.read_text(encoding="utf-8")
    if model == "hgm3":
        chosen = hgm3_config.named_config(config, mask=mask)
        return hgm3.assemble(data, run, output, chosen, card=text, overwrite=overwrite).reference
    if model == "evaluator":
        judge = evaluator_config.named_config(config)
        return evaluator.assemble(data, run, output, judge, card=text, overwrite=overwrite).reference
    return mogo.assemble(data, run, output, mogo_config.named_config(config), card=text, overwrite=overwrite).reference


def take_bundle_apart(model: Literal["hgm3", "mogo"], bundle: str, run: Path) -> str:
    """Write the parts of a bundle into a run folder; the name of its configuration."""
    try:
        from shared.bundles import find_bundle
        from workers.hgm3 import assembly as hgm3
        from workers.mogo import assembly as mogo
    except ImportError as error:
        raise needs_extra("worker", error) from error
    take_apart = hgm3.take_apart if model == "hgm3" else mogo.take_apart
    return take_apart(find_bundle(bundle), run).name


def renew_reference(bundle: str, data: Path, output: Path, *, overwrite: bool) -> str:
    """Write an evaluator's networks with a reference of these data; the new bundle's exact reference."""
    try:
        from shared.bundles import find_bundle
        from workers.evaluator.assembly import renew_reference
    except ImportError as error:
        raise needs_extra("worker", error) from error
    return renew_reference(find_bundle(bundle), data, output, overwrite=overwrite).reference


def reconstruct(
    evaluator: str, generator: str, data: Path, output: Path | None, progress: Callable[[int, int], None]
) -> dict[str, Any]:
    """Measure a generator's tokenizer on real clips; a bundle's row is kept beside the evaluator's bundle.

    Args:
        evaluator: a bundle.
        generator: a bundle, or a folder of finished parts, whose reconstruction only the report tells.
        data: the prepared folder that the evaluator's reference is of.
        output: a report, .html, .json or .md.
        progress: called with (clips done, clips in all).

    Raises:
        NotFound, InvalidBundle, InvalidFile: of the bundles and the data.
        InvalidInput: they do not belong together, or the report's file has another ending.
    """
    try:
        from shared.bundles import find_bundle
        from workers.evaluator import report, tokenizers
        from workers.evaluator.loading import load_evaluator
        from workers.evaluator.reconstruction import reconstruct
        from workers.evaluator.reference import Reference
        from workers.training.data.prepared import PreparedData
    except ImportError as error:
        raise needs_extra("worker", error) from error
    writers = {".html": report.to_html, ".json": report.to_json, ".md": report.to_markdown}
    if output is not None and output.suffix not in writers:
        raise InvalidInput("the file's ending is no report's", where=str(output), hint=f"Use {', '.join(writers)}.")
    judge = find_bundle(evaluator)
    name, licence, tokenizer = _open_tokenizer(generator)
    prepared, real = PreparedData.open(data), Reference.of(judge)
    loaded = load_evaluator(judge, device="cpu")
    rebuilt = reconstruct(prepared, real, loaded, name, tokenizer, progress=progress)
    if licence is not None:
        rebuilt.reconstruction.save(judge)
    if output is not None:
        told = tokenizers.tokenizer_report(rebuilt, loaded, real, prepared, licence=licence or "of its data")
        output.write_bytes(writers[output.suffix](told))
    return rebuilt.reconstruction.model_dump(mode="json")


def _open_tokenizer(generator: str) -> tuple[str, str | None, MotionTokenizer]:
    """Exact name, licence (None = of a run, which has none yet) and tokenizer, in evaluation mode."""
    from shared.bundles import choose_bundle
    from shared.hashing import sha256_of
    from workers.hgm3 import bundle as hgm3
    from workers.hgm3 import config as hgm3_config
    from workers.hgm3 import tokenizer as hgm3_tokenizer
    from workers.mogo import bundle as mogo
    from workers.mogo import config as mogo_config
    from workers.mogo import tokenizer as mogo_tokenizer
    from workers.training.parts import load_part

    folder = Path(generator) / "tokenizer" / "part"
    if (folder / "part.json").is_file():
        part = load_part(folder)
        if "masked" in part.config:
            tokenizer = hgm3_tokenizer.Tokenizer(hgm3_config.HGM3Config.from_dict(part.config))
        else:
            tokenizer = mogo_tokenizer.Tokenizer(mogo_config.MOGOConfig.from_dict(part.config))
        tokenizer.load_state_dict({name: value.float() for name, value in part.state.items()}, strict=False)
        sha256 = sha256_of(folder / "weights.safetensors")[:12]
        return f"{Path(generator).resolve().name}@{sha256}", None, tokenizer.eval()
    found = choose_bundle(generator)
    networks = {"hgm3": lambda: hgm3.load_networks(found)[1].tokenizer, "mogo": lambda: mogo.load_networks(found)[1]}
    if found.manifest.model not in networks:
        raise InvalidInput(f"{found.manifest.name!r} has no tokenizer", where=str(found.path))
    return found.reference, found.manifest.licence, networks[found.manifest.model]()


def needs_extra(extra: str, error: ImportError) -> InvalidInput:
    """The error for a command that the small client cannot run."""
    return InvalidInput(
        f"this needs what the extra {extra!r} installs ({error.name or error} is missing)",
        hint=f"pip install 'marey[{extra}]', or use a server: `marey submit`.",
    )
