"""The trained forecasters, for experiments that stand on them."""

from cpl.experiments.run.spec import Inputs, Need
from cpl.experiments.trained import forecasts
from cpl.experiments.trained.pairs import with_pair
from cpl.forecast import stored
from cpl.forecast.methods import Forecaster
from cpl.network import MLP, Model
from cpl.rng import stream

__all__ = ["crash_classifier", "forecaster", "need_forecasters", "suite_of"]

_LENGTH = 5  # observations in a history (Section IV, Predictor Training)
_HORIZON = 3  # [steps] how far a forecast looks


def need_forecasters(models: str, pair: int) -> Need:
    """Ask for the forecasters of a pair.

    Args:
        models: Profile that trained them.
        pair: Which pair.

    Examples:
        >>> need_forecasters("paper", 2).shards
        ('pair-2',)
    """
    settings = with_pair(forecasts.PROFILES[models], pair)
    return Need(experiment="forecasts", config=settings, shards=(f"pair-{pair}",))


def suite_of(inputs: Inputs, pair: int) -> Model:
    """Return everything that was learned for a pair.

    Args:
        inputs: What `run_shard` was given.
        pair: Which pair.

    Raises:
        ValueError: If it was not asked for.
        cpl.store.DamagedModelError: If its file is damaged.
        cpl.forecast.WrongModelError: If it is another model.
    """
    tables, name = inputs["forecasts"], f"pair-{pair}"
    if name not in tables:
        raise ValueError(f"pair must be among {sorted(tables)}, got {name!r}")
    content = tables[name]["model"].iloc[0]
    return stored.read_suite(content, length=_LENGTH, horizon=_HORIZON)


def forecaster(inputs: Inputs, method: str, pair: int, *, calibrated: bool) -> Forecaster:
    """Return a trained forecaster.

    Args:
        inputs: What `run_shard` was given.
        method: Of `cpl.forecast.METHODS`; "conformal" is the network to which a tracked quantile is
            added, "none" the same network without, or, calibrated, with one constant.
        pair: Which pair.
        calibrated: Whether its uncertainty covers 90 % of the training range; else as published.

    Raises:
        ValueError: If the method is unknown, or the pair was not asked for.
        cpl.store.DamagedModelError: If its file is damaged.
        cpl.forecast.WrongModelError: If it is another model.
    """
    rng = stream(pair, "forecaster", method)
    return stored.forecaster(suite_of(inputs, pair), method, calibrated=calibrated, rng=rng)


def crash_classifier(inputs: Inputs, pair: int) -> MLP:
    """Return the network that gives the probability of a crash within the horizon."""
    return stored.crash_classifier(suite_of(inputs, pair))
