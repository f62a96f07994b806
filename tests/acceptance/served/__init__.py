"""Tests of the product as a whole, by its command line; a package, for fixtures that end with it."""
