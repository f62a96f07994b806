"""Model bundles: a folder with `manifest.json`, safetensors shards and a model card. No pickle, ever."""

from marey.bundles.bundle import Bundle
from marey.bundles.choose import choose_bundle, choose_evaluator, named_by
from marey.bundles.find import BrokenBundle, Bundles, find_bundle, list_bundles, scan_bundles
from marey.bundles.manifest import BundleManifest, DataSource, FileEntry, TextSpec
from marey.bundles.writer import BundleWriter

__all__ = [
    "BrokenBundle",
    "Bundle",
    "BundleManifest",
    "BundleWriter",
    "Bundles",
    "DataSource",
    "FileEntry",
    "TextSpec",
    "choose_bundle",
    "choose_evaluator",
    "find_bundle",
    "list_bundles",
    "named_by",
    "scan_bundles",
]
