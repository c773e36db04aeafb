"""How does it look? Tables and arrays in, matplotlib figures out.

One module a part of the book (`cpl.figures.theory`, `cpl.figures.road`, ...) and one visual
language (`cpl.figures.style`). Nothing here computes a result or starts an experiment. This file
imports none of its modules, so that a chapter depends only on the figures it draws.
"""
