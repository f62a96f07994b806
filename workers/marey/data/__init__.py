"""Training data: prepare folders from archives of captures, and read them."""
