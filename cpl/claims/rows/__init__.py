"""One file a claim, `c<row>_<slug>.py`: what is claimed, where, and the rule that decides it.

A file is found by its folder and holds one `CLAIM`. What several rules share is in the files with a
leading underscore. CONTRIBUTING.md has the recipe for a new one.
"""
