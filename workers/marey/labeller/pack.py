"""The bundle of the role labeller: weights, data credits, licence, scores."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.labeller.card import card
from marey.labeller.fit import PROPBANK_FIT
from marey.text.light import UPDATES

if TYPE_CHECKING:
    from marey.labeller.recipe import Evaluation, Recipe
    from marey.labeller.weights import Weights

SENTENCES = DataSource(
    name="Marey's annotated sentences (workers/marey/labeller/sentences)",
    licence="MIT",
    credit="made up and annotated for Marey; no caption of a data set, no output of a parser",
)
PROPBANK = DataSource(
    name="PropBank of the English Web Treebank (github.com/propbank/propbank-release)",
    licence="CC-BY-SA-4.0",
    credit="The PropBank project: Palmer et al. 2005, Pradhan et al. 2022",
)
TREEBANK = DataSource(
    name="Universal Dependencies English Web Treebank (github.com/UniversalDependencies/UD_English-EWT)",
    licence="CC-BY-SA-4.0",
    credit="Silveira et al. 2014; Bies et al. 2012",
)


def pack(
    output: Path, weights: Weights, sentences: Sequence[Path], recipe: Recipe, result: Evaluation | None
) -> Bundle:
    """Write the bundle; weights that were trained on PropBank carry its terms."""
    hashes = [hashlib.sha256(file.read_bytes()).hexdigest() for file in sentences]
    sources = [SENTENCES.model_copy(update={"sha256": sha256}) for sha256 in hashes]
    if recipe.first:
        sources += [PROPBANK, TREEBANK]
    with BundleWriter(output, overwrite=True) as writer:
        writer.add_part("labeller", {name: value.numpy() for name, value in weights.head.items()})
        writer.add_part(UPDATES, {name: value.numpy() for name, value in weights.updates.items()})
        writer.add_card(card(result))
        return writer.finish(
            name=output.name,
            version="1",
            kind="labeller",
            model="light",
            config="light",
            parameters={**asdict(weights.network), "minilm_sha256": recipe.minilm.weights_sha256},
            data=tuple(sources),
            licence="CC-BY-SA-4.0" if recipe.first else SENTENCES.licence,
            metrics=result.metrics() if result else {},
            training={
                "command": "python -m marey.labeller.train",
                "seed": recipe.seed,
                **asdict(recipe.config),
                **asdict(recipe.pool),
                **({"first": asdict(PROPBANK_FIT)} if recipe.first else {}),
            },
        )
