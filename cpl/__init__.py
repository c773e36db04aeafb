"""Trackers, road and experiments behind the companion to "Conformal Policy Learning"."""

from cpl.environ import keep_compiled_code

keep_compiled_code()  # before any kernel is imported
