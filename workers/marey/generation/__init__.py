"""What all generators share: requests, the handler of a queue, the way from features to files."""
