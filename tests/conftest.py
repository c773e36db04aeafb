"""What holds for every test: hypothesis draws the same examples each time under CI."""

import os

from hypothesis import HealthCheck, settings

# Deadlines measure the machine, not the code.
settings.register_profile(
    "book", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.register_profile("ci", parent=settings.get_profile("book"), derandomize=True)
# Enough to walk every branch once, where coverage is what is measured.
settings.register_profile("glance", parent=settings.get_profile("ci"), max_examples=4)
settings.load_profile(os.environ.get("CPL_HYPOTHESIS", "ci" if os.environ.get("CI") else "book"))
