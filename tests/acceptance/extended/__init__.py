"""Tests of the product with what extends it; a package, for fixtures that end with it."""
