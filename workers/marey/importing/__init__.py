"""Import of published weights: `marey models import`. Files of other projects become bundles, once, offline.

An import kind is a function of an `ImportRequest` that reads files through a `Download` and writes a bundle:

    def import_example(request: ImportRequest) -> Bundle:
        download = Download(request.folder, inside=("checkpoints/t2m",))
        file = download.find("example_*/model/latest.tar", what="the transformer")
        options = download.options(file.parent.parent / "opt.txt")
        network = Network(Config(layers=options.integer("n_layers")))
        checkpoint = download.checkpoint(file)
        section = checkpoint.section("t2m_transformer", "trans")
        section.fill(network, published_name)
        section.ignore(r"position_enc\\.pe", "computed anew")
        statistics = download.statistics(file.parent.parent / "meta", 263)
        accounts = download.finish()  # refuses tensors that are neither used nor ignored
        with text_encoder_of(request, "clip-vit-b32") as text:
            card = make_card(request, accounts, about=ABOUT, normalisation=NORMALISATION, text=text)
            return write_generator(
                request.output, "example", config, parts, statistics, text=text, card=card, dtype=np.float32,
                overwrite=request.overwrite, licence=request.licence, data=DATA,
                training=provenance(request, accounts),
            )

Nothing is written before everything is read and checked.
"""

from marey.importing.card import make_card, provenance
from marey.importing.checkpoint import Account, Checkpoint, Section
from marey.importing.download import Download, Statistics
from marey.importing.encoders import spec_of, text_encoder_of
from marey.importing.fields import Fields, read_json_fields, read_options, read_yaml
from marey.importing.request import ImportRequest, find_kind, run_import

__all__ = [
    "Account",
    "Checkpoint",
    "Download",
    "Fields",
    "ImportRequest",
    "Section",
    "Statistics",
    "find_kind",
    "make_card",
    "provenance",
    "read_json_fields",
    "read_options",
    "read_yaml",
    "run_import",
    "spec_of",
    "text_encoder_of",
]
