"""Make ``golden.json``: what public code says of one sequence of scores.

    python -m venv scratch
    scratch/bin/pip install --no-deps adaptive-conformal-inference==1.0.1 online-conformal==1.0.2 \\
        conformalopt==0.1.0 dracp==0.2.0 online-cp==0.4.0
    scratch/bin/pip install numpy pandas scipy scikit-learn statsmodels tqdm matplotlib
    git clone https://github.com/creator-xi/Error-quantified-Conformal-Inference eci
    git clone https://github.com/Jordylek/conformal-decision cdt     # both of November 2026
    scratch/bin/python tests/conformal/family/make_golden.py eci cdt > golden.json

None of these packages is needed to run the tests. ``online-conformal`` imports a forecasting
library that plays no part in what is compared here; an empty stand-in is enough.
"""

import importlib.metadata
import json
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pandas as pd

ALPHA = 0.1


def main() -> None:
    """Print the vectors as JSON."""
    eci, cdt = map(Path, sys.argv[1:3])
    scores = _scores()
    vectors = {
        **_aci(scores),
        **_online_conformal(scores),
        **_conformalopt(scores),
        **_plain(scores),
        **_eci(scores, eci),
        **_decision(scores, cdt),
    }
    packages = ["adaptive-conformal-inference", "online-conformal", "conformalopt", "dracp"]
    packages += ["online-cp", "numpy", "pandas"]
    versions = {name: importlib.metadata.version(name) for name in packages}
    for folder in (eci, cdt):
        commit = ["git", "-C", str(folder), "rev-parse", "HEAD"]
        versions[folder.name] = subprocess.check_output(commit, text=True).strip()
    found = {"alpha": ALPHA, "versions": versions, "scores": scores.tolist()}
    found["change"] = _change(scores)
    found["q"] = {name: np.asarray(q).tolist() for name, q in vectors.items()}
    json.dump(found, sys.stdout)
    sys.stdout.write("\n")


def _scores() -> np.ndarray:
    """Return scores that grow by half at a third of the way and calm down after two thirds."""
    rng = np.random.default_rng(20)
    scale = np.repeat([1.0, 1.5, 0.4], 60)
    return np.abs(rng.normal(size=180)) * scale


def _aci(scores: np.ndarray) -> dict[str, list[float]]:
    from aci import ACI

    out = {}
    for clip in (False, True):
        tracker, q = ACI(alpha=ALPHA, gamma=0.03, lookback=40, clip_alpha=clip), []
        for s in scores:
            q.append(tracker.issue(0.0)[1])
            tracker.observe(s)
        out[f"aci clip={clip}"] = q
    return out


def _online_conformal(scores: np.ndarray) -> dict[str, list[float]]:
    merlion = {"merlion.models.forecast.base": "ForecasterBase", "merlion.utils": "TimeSeries"}
    for module, name in merlion.items():
        parts = module.split(".")
        for k in range(1, len(parts) + 1):
            sys.modules.setdefault(".".join(parts[:k]), types.ModuleType(".".join(parts[:k])))
        setattr(sys.modules[module], name, object)
    sys.modules["online_conformal.enbpi"] = types.ModuleType("online_conformal.enbpi")
    sys.modules["online_conformal.enbpi"].EnbMixIn = type("EnbMixIn", (), {})
    from online_conformal.faci import FACI
    from online_conformal.ogd import ScaleFreeOGD
    from online_conformal.saocp import SAOCP

    def run(tracker) -> list[float]:
        q = []
        for s in scores:
            q.append(float(tracker.predict(horizon=1)[1]))
            tracker.update(pd.Series([s]), pd.Series([0.0]), horizon=1)
        return q

    plain = {"model": None, "train_data": None, "coverage": 1 - ALPHA}
    found = {
        "sf_ogd": run(ScaleFreeOGD(**plain, max_scale=2.0)),
        "saocp as it is": run(SAOCP(**plain, max_scale=2.0)),
        "dtaci": run(FACI(**plain)),
    }
    # An expert that is all of the mixture gains nothing over it, but for rounding; whether that is
    # 1e-17 or -1e-17 then decides about all the weight. Here such a gain is none.
    quiet = types.SimpleNamespace(**vars(np))
    quiet.clip = lambda gain, low, high: np.clip(gain, low, high) if abs(gain) > 1e-12 else 0.0
    sys.modules["online_conformal.saocp"].np = quiet
    return {**found, "saocp": run(SAOCP(**plain, max_scale=2.0))}


def _conformalopt(scores: np.ndarray) -> dict[str, list[float]]:
    from conformalopt.main import ConformalPredictor

    out = {}
    for kind, lr in (("fixed", 0.1), ("decaying", 1.0)):
        tracker = ConformalPredictor(
            alpha=ALPHA, lr_type=kind, quantile_tracker="scalar", hypers={"lr": lr}
        )
        tracker.init_active_fields()
        tracker.quantile_tracker_parameter = np.zeros(1)
        q = []
        for s in scores:
            q.append(float(tracker.predict()))
            tracker.step(q[-1], s)
        out[kind] = q
    return out


def _plain(scores: np.ndarray) -> dict[str, list[float]]:
    from dracp.quantiles import ordinary_conformal_quantile

    series = pd.Series(scores)
    mean = series.ewm(alpha=0.1, adjust=False).mean()
    spread = series.ewm(alpha=0.1, adjust=False).std(bias=True)
    rolling = [np.quantile(scores[max(t - 25, 0) : t], 1 - ALPHA, method="inverted_cdf")
               for t in range(1, len(scores))]  # fmt: skip
    return {
        "ewma": [0.0, *(mean + 1.5 * spread).tolist()[:-1]],
        "rolling": [0.0, *map(float, rolling)],
        "split": [ordinary_conformal_quantile(scores[:50], ALPHA)],
    }


def _eci(scores: np.ndarray, folder: Path) -> dict[str, list[float]]:
    setattr(np, "infty", np.inf)  # noqa: B010 - the code was written for numpy 1
    sys.path.insert(0, str(folder))
    from core import methods

    level = pd.Series(scores).ewm(alpha=0.2, adjust=False).mean().to_numpy()
    forecasts = np.concatenate([[0.0], level[:-1]])
    data = pd.DataFrame({"scorecasts": [(0.0, g) for g in forecasts]})
    plain = {"T_burnin": 30, "ahead": 1}
    pid = methods.quantile_integrator_log_scorecaster(
        scores, ALPHA, 0.1, data, 30, 5.0, 0.5, True, 1, proportional_lr=False
    )
    return {
        "trailing": methods.trailing_window(scores, ALPHA, None, 40, 1)["q"],
        "eci": methods.ECI(scores, ALPHA, 0.1, **plain)["q"],
        "eci cutoff": methods.ECI_cutoff(scores, ALPHA, 0.1, **plain)["q"],
        "eci integral": methods.ECI_integral(scores, ALPHA, 0.1, **plain)["q"],
        "pid": pid["q"],
    }


def _change(scores: np.ndarray) -> dict[str, list[float]]:
    """Return a martingale's factors over ranks, and the three statistics of change made of them."""
    from online_cp.martingale import (
        CUSUMWrapper,
        ShiryaevRobertsWrapper,
        SimpleJumper,
        VilleWrapper,
    )

    makers = (VilleWrapper, CUSUMWrapper, ShiryaevRobertsWrapper)
    found = {name: [] for name in ("factors", "ville", "cusum", "shiryaev_roberts")}
    wrapped = [maker(SimpleJumper(J=0.1)) for maker in makers]
    before = 0.0
    for t in range(1, len(scores)):
        p = float(np.mean(scores[: t + 1] >= scores[t]))
        for each in wrapped:
            each.update(p)
        now = float(wrapped[0].martingale.logM)
        found["factors"].append(np.exp(now - before))
        before = now
        found["ville"].append(float(np.exp(now)))
        found["cusum"].append(float(wrapped[1].gamma))
        found["shiryaev_roberts"].append(float(wrapped[2].R))
    return found


def _decision(scores: np.ndarray, folder: Path) -> dict[str, list[float]]:
    sys.path.insert(0, str(folder))
    from conformal_decider.base_decider import BaseConformalDecider

    class Ramp(BaseConformalDecider):
        """Caution is minus their boldness; the loss is the excess of the score over it."""

        def decision_function(self, features, lam):
            return -lam

        def update_target(self, t):
            return scores[t]

        def loss_function(self, decision, target):
            return float(np.clip((target - decision) / 0.5, 0.0, 1.0))

    run = Ramp(epsilon=ALPHA, eta=0.2, horizon=len(scores)).run_decider(0.0)
    return {"decision": (-run["lambdas"][:-1]).tolist()}


if __name__ == "__main__":
    main()
