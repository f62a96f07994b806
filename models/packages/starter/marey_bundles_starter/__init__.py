"""Bundles for Marey under CC BY-NC 4.0; found through the entry-point group `marey.bundles`."""
