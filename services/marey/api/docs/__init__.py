"""The API reference as a page, from files of this package alone."""
