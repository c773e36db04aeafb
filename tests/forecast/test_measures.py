"""Skill and the area under the ROC curve."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.forecast.measures import auc, skill

SCORED = st.lists(st.tuples(st.integers(0, 6), st.booleans()), min_size=1, max_size=40)


@given(SCORED)
def test_auc_is_the_share_of_pairs_in_order(rows):
    score, label = np.array([s for s, _ in rows]), np.array([b for _, b in rows])
    pairs = [(a > b) + 0.5 * (a == b) for a in score[label] for b in score[~label]]
    found = auc(score, label)
    assert np.isnan(found) if not pairs else found == pytest.approx(np.mean(pairs))


@given(SCORED)
def test_auc_turns_round_with_the_score(rows):
    score, label = np.array([s for s, _ in rows]), np.array([b for _, b in rows])
    np.testing.assert_allclose(auc(score, label), 1 - auc(-score, label))


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match=r"numbers of shape \(2,\)"):
        auc([0.1, np.nan], [True, False])
    with pytest.raises(ValueError, match="reference must have errors"):
        skill([0.1], [0.0])
