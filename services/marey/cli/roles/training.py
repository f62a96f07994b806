"""Training stages and bundles, for `marey train`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import Training, find_model, models_with, resolve


def train_stage(
    training: Training,
    name: str,
    data: Path,
    run: Path,
    *,
    config: str,
    steps: int | None,
    minutes: float | None,
    rate: float | None = None,
    choices: Mapping[str, str] | None = None,
    origin: str | None = None,
    **options: Any,
) -> dict[str, float]:
    """Train one stage, and return its metrics.

    Args:
        choices: of the model's own options.
        origin: name or path of a bundle whose weights are begun from.
        options: of `marey.training.staging.TrainOptions`.
    """
    with extra("train"):
        from marey.bundles import find_bundle
        from marey.training.config_file import open_config
        from marey.training.optimisation import with_learning_rate
        from marey.training.staging import TrainOptions, choose_budget

        named_config, train = resolve(training.config), resolve(training.train)
    chosen = with_learning_rate(open_config(named_config, config, choices), name, rate)
    options["origin"] = None if origin is None else find_bundle(origin)
    return train(name, TrainOptions(data, run, chosen, choose_budget(chosen, name, data, steps, minutes), **options))


def show_config(training: Training, config: str) -> str:
    """Return a configuration file with every field, from a preset or another file."""
    with extra("train"):
        from marey.training.config_file import open_config, preset_of, write_toml

        named_config = resolve(training.config)
    return write_toml(open_config(named_config, config), preset_of(config))


def estimate_memory(
    training: Training, config: str, samples: int | str | None, *, recompute: bool, gigabytes: float | None, bf16: bool
) -> dict[str, Any]:
    """Estimate the memory of the stage that needs most.

    Args:
        samples: of a pass; "auto" = as many as fit; None = the whole batch.
        gigabytes: memory of a GPU for "auto"; None = that of this device.

    Returns:
        stage, samples a pass, samples of a batch, and GiB of each part and their sum.
    """
    assert training.memory is not None  # else there is no such command
    with extra("train"):
        import torch

        from marey.nn.devices import choose_device
        from marey.training.config_file import open_config
        from marey.training.memory import GIB, counted_for, device_memory

        named_config, memory_model = resolve(training.config), resolve(training.memory)
    chosen = open_config(named_config, config)
    here = choose_device("auto") if samples == "auto" and gigabytes is None else torch.device("cuda")
    with counted_for(here):
        model = memory_model(chosen, bf16=bf16)
    if samples == "auto":
        room = device_memory(here) if gigabytes is None else 1e9 * gigabytes
        found = model.fit(room, recompute=recompute)
    else:
        found = model.estimate(samples or model.batch, recompute=recompute)
    parts = {name: size / GIB for name, size in {**found.parts, "sum": found.total}.items()}
    return {"stage": model.stage, "samples": found.samples, "batch": model.batch, "gib": parts}


def assemble_bundle(
    training: Training,
    data: Path,
    run: Path,
    output: Path,
    *,
    config: str,
    card: Path | None,
    overwrite: bool,
    choices: Mapping[str, str] | None = None,
) -> str:
    """Write the bundle of a run, and return its exact reference."""
    with extra("train"):
        from marey.training.config_file import open_config

        named_config, assemble = resolve(training.config), resolve(training.assemble)
    text = None if card is None else card.read_text(encoding="utf-8")
    chosen = open_config(named_config, config, choices)
    return assemble(data, run, output, chosen, card=text, overwrite=overwrite).reference


def mean_of_runs(stage: str, runs: Sequence[Path], run: Path) -> None:
    """Write the mean of the finished parts of a stage in several runs into a run folder."""
    with extra("train"):
        from marey.training.parts import load_part, mean_part, save_part
    folders = [each / stage / "part" for each in runs]
    mean = mean_part({str(folder): load_part(folder) for folder in folders})
    save_part(run / stage / "part", mean)


def unpack_bundle(training: Training, bundle: str, run: Path) -> str:
    """Write the parts of a bundle into a run folder, and return the name of its configuration."""
    assert training.unpack is not None  # else there is no such command
    with extra("train"):
        from marey.bundles import find_bundle

        unpack = resolve(training.unpack)
    return unpack(find_bundle(bundle), run).name


def renew_reference(bundle: str, data: Path, output: Path, *, overwrite: bool) -> str:
    """Write an evaluator's networks with a reference of these data; the new bundle's exact reference."""
    with extra("train"):
        from marey.bundles import find_bundle
        from marey.evaluator.assembly import renew_reference
    return renew_reference(find_bundle(bundle), data, output, overwrite=overwrite).reference


def self_train(
    bundle: str,
    data: Path,
    run: Path,
    *,
    captions: int,
    seed: int,
    threads: int,
    progress: Callable[[str], None],
) -> int:
    """Draw motions for training captions, and leave those that do what the caption says in a run; how many.

    Raises:
        InvalidInput: the bundle's model cannot be trained on its own motions.
    """
    with extra("train"):
        from marey.bundles import choose_bundle
        from marey.data.prepared import PreparedData
        from marey.training.adherence import pipeline_of
    found = choose_bundle(bundle)
    spec = find_model(found.manifest.model)
    if spec is None or spec.self_train is None:
        raise InvalidInput(
            f"the model {found.manifest.model!r} has no self-training",
            where=bundle,
            hint=f"Models that have: {', '.join(models_with('self_train')) or 'none'}.",
        )
    generator = resolve(spec.load)(found, threads=threads)
    prepared = PreparedData.open(data)
    return resolve(spec.self_train)(
        generator, pipeline_of(generator), prepared, run, captions=captions, seed=seed, progress=progress
    )


def ablate(
    name: str | None,
    data: Path,
    bundle: str,
    output: Path,
    *,
    steps: int,
    batch: int | None,
    seeds: int,
    threads: int,
    other: Path | None = None,
    evaluator: str | None = None,
    repeats: int = 20,
) -> str:
    """Train and measure variants of a bundle's model; a Markdown table.

    Args:
        name: of the ablation; None = the only one of the model.
        other: prepared data that the ablation `data` adds.
        evaluator: also measures the variants by the published protocol, `repeats` times.

    Raises:
        InvalidInput: the model has no such ablation, or several and none is named.
    """
    with extra("train"):
        from marey.bundles import choose_bundle
    found = choose_bundle(bundle)
    spec = find_model(found.manifest.model)
    known = {each.name: each for each in (spec.ablations if spec else ())}
    if name is None and len(known) == 1:
        (name,) = known
    if name not in known:
        raise InvalidInput(
            f"the model {found.manifest.model!r} has no ablation {name!r}"
            if name
            else "the model has several ablations",
            where="--what",
            hint=f"Known: {'; '.join(f'{each.name} ({each.help})' for each in known.values()) or 'none'}.",
        )
    if other is not None and name != "data":
        raise InvalidInput(f"the ablation {name!r} adds no data", where="--with", hint="Leave it out.")
    with extra("train"):
        from marey.training.ablation import AblationRequest

        run = resolve(known[name].run)
    protocol = None
    if evaluator is not None:
        from marey.cli.roles.protocol import measure_rows

        protocol = measure_rows(data, evaluator, repeats)
    return run(AblationRequest(data, bundle, output, steps, batch, seeds, threads, other, protocol))
