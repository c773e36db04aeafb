"""The companion to "Conformal Policy Learning": trackers, road, experiments and the book."""
