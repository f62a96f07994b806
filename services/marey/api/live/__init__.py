"""The page that shows a live stream."""
