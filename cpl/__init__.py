"""Trackers, road and experiments behind the companion to "Conformal Policy Learning"."""
