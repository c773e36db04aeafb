"""What the car does: hand-written rules, learners, the switch."""

from cpl.policies.greedy import Greedy
from cpl.policies.headway import Headway

__all__ = ["Greedy", "Headway"]
