"""The page that displays a live stream."""
