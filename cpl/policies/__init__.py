"""What the car does: hand-written rules, learners, the switch."""
