"""Settings of a chapter or an experiment: what each may be, and how `name=value` is read."""
