"""What can go wrong between rollouts, a history and a forecaster, by name."""

__all__ = ["HistoryShapeError", "NoRolloutsError", "TrainingDivergedError", "WrongModelError"]


class HistoryShapeError(ValueError):
    """A forecaster was given a history of another shape than it was trained on."""


class NoRolloutsError(ValueError):
    """There is no rollout, or none that is long enough for one forecast and its truth."""


class TrainingDivergedError(RuntimeError):
    """A loss became NaN or infinite; no network is returned."""


class WrongModelError(ValueError):
    """A stored model holds other networks, or was made with another configuration, than asked."""
