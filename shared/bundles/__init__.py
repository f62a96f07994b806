"""Model bundles: a folder with `manifest.json`, safetensors shards and a model card. No pickle, ever."""

from shared.bundles.bundle import Bundle, find_bundle, list_bundles
from shared.bundles.choose import choose_bundle, choose_evaluator, named_by
from shared.bundles.manifest import BundleManifest, DataSource, FileEntry, TextSpec
from shared.bundles.writer import BundleWriter

__all__ = [
    "Bundle",
    "BundleManifest",
    "BundleWriter",
    "DataSource",
    "FileEntry",
    "TextSpec",
    "choose_bundle",
    "choose_evaluator",
    "find_bundle",
    "list_bundles",
    "named_by",
]
