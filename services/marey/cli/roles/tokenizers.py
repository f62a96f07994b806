"""Reconstruction errors of a tokenizer, for `marey train evaluator reconstruct`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import find_model, model_names, resolve

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.nn.motion_tokenizer import MotionTokenizer


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
    with extra("worker"):
        from marey.bundles import find_bundle
        from marey.data.prepared import PreparedData
        from marey.evaluator import report, tokenizers
        from marey.evaluator.loading import load_evaluator
        from marey.evaluator.reconstruction import reconstruct
        from marey.evaluator.reference import RealClips
    writers = {".html": report.to_html, ".json": report.to_json, ".md": report.to_markdown}
    if output is not None and output.suffix not in writers:
        raise InvalidInput("the file's ending is no report's", where=str(output), hint=f"Use {', '.join(writers)}.")
    judge = find_bundle(evaluator)
    name, licence, tokenizer = _open_tokenizer(generator)
    prepared, real = PreparedData.open(data), RealClips.of(judge)
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
    from marey.bundles import choose_bundle
    from marey.core.hashing import sha256_of
    from marey.training.parts import load_part

    folder = Path(generator) / "tokenizer" / "part"
    if (folder / "part.json").is_file():
        part = load_part(folder)
        tokenizer = _tokenizer_of_run(part.config, folder)
        tokenizer.load_state_dict({name: value.float() for name, value in part.state.items()}, strict=False)
        sha256 = sha256_of(folder / "weights.safetensors")[:12]
        return f"{Path(generator).resolve().name}@{sha256}", None, tokenizer.eval()
    found = choose_bundle(generator)
    tokenizer = tokenizer_of(found)
    if tokenizer is None:
        raise InvalidInput(f"{found.manifest.name!r} has no tokenizer", where=str(found.path))
    return found.reference, found.manifest.licence, tokenizer


def tokenizer_of(bundle: Bundle) -> MotionTokenizer | None:
    """The tokenizer of a generator's bundle, in evaluation mode on the CPU; None where its model has none."""
    import torch

    from marey.nn.bundling import fill

    spec = find_model(bundle.manifest.model)
    if spec is None or spec.tokenizer is None:
        return None
    tokenizer = resolve(spec.tokenizer)(bundle.manifest.parameters)
    fill(tokenizer, bundle, "tokenizer")
    tokenizer.set_statistics(*map(torch.from_numpy, bundle.statistics()))
    return tokenizer


def _tokenizer_of_run(parameters: Mapping[str, Any], folder: Path) -> MotionTokenizer:
    """The untrained tokenizer of the model whose configuration a run's part holds.

    Raises:
        InvalidInput: no model that is installed here reads it.
    """
    for spec in filter(None, map(find_model, model_names())):
        if spec.tokenizer is not None:
            with suppress(InvalidInput):  # of another model: it has fields that this one has not
                return resolve(spec.tokenizer)(parameters)
    raise InvalidInput("no model that is installed here reads this configuration", where=str(folder))
