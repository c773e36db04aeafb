"""The machinery: what an experiment is, how its pieces are computed, kept, published and timed."""
