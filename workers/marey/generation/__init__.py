"""Code that all generators share: requests, the handler of a queue, the export of features to files."""
