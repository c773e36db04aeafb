"""The graders: right answers reach all points, stubs none, and likely mistakes are caught.

A wrong answer is the reference with a part exchanged, so that it is wrong in one way only. What is
listed here is what students get wrong, and worth reading before a laboratory.
"""

import json

import pytest

from cpl.course.editions import pages_of
from cpl.course.grading import laboratories, mark, questions_of
from cpl.course.labs import assign, grade, master
from cpl.course.links import targets_of
from cpl.publish.chapters import find_chapters
from cpl.store import project_root

ROOT = project_root()
LABS = laboratories(find_chapters(ROOT))
QUESTIONS = {q.label: (name, q) for name, lab in LABS.items() for q in questions_of(lab)}

WRONG = {
    "ex-lab-threshold": {
        "forgets that the new score is one of n + 1": ("(len(ordered) + 1)", "len(ordered)"),
        "counts ranks from zero": ("ordered[k - 1]", "ordered[min(k, len(ordered) - 1)]"),
        "is finite with too little data": ("else math.inf", "else float(ordered[-1])"),
        "rounds down": ("math.ceil(", "math.floor("),
        "does not sort": ("sorted(scores)", "list(scores)"),
    },
    "ex-lab-follow": {
        "has the sign of the paper": ("q + eta * (err - alpha)", "q - eta * (err - alpha)"),
        "counts a tie as an error": ("err = s > q", "err = s >= q"),
        "aims at 1 - alpha": ("(err - alpha)", "(err - 1 + alpha)"),
        "moves before it notes": (
            "qs.append(q)\n        errs.append(bool(err))\n        q = q + eta * (err - alpha)",
            "q = q + eta * (err - alpha)\n        qs.append(q)\n        errs.append(bool(err))",
        ),
        "clips at zero": ("q + eta * (err - alpha)", "max(0.0, q + eta * (err - alpha))"),
        "begins at zero": ("q, qs, errs = q0", "q, qs, errs = 0.0"),
    },
    "ex-lab-pinball": {
        "exchanges alpha and 1 - alpha": (
            "(1 - alpha) * u, -alpha * u",
            "alpha * u, (alpha - 1) * u",
        ),
        "is the mean distance": ("max((1 - alpha) * u, -alpha * u)", "abs(u)"),
        "adds up": (" / len(gaps)", ""),
        "has the gap the wrong way round": ("s - q for", "q - s for"),
    },
    "ex-lab-worst-count": {
        "is the bound of the paper": (
            "min(W, math.ceil(alpha * W + Fraction(B) / eta) + delay - 1)",
            "math.floor(alpha * W + Fraction(B) / eta + 1)",
        ),
        "forgets the length of the window": ("min(W, ", "min(10**9, "),
        "rounds down": ("math.ceil(", "math.floor("),
        "adds the whole delay": ("+ delay - 1", "+ delay"),
        "multiplies by the delay": (
            "math.ceil(alpha * W + Fraction(B) / eta) + delay - 1",
            "delay * math.ceil(alpha * W + Fraction(B) / eta)",
        ),
        "has W + 1 terms": ("alpha * W", "alpha * (W + 1)"),
    },
    "ex-lab-worst-scores": {
        "does not use the step before": ("[0] + [B] * W", "[B] * (W + 1)"),
        "shows nothing": ("[0] + [B] * W", "[0] * (W + 1)"),
        "takes turns": ("[0] + [B] * W", "[0] + [B * (i % 2) for i in range(W)]"),
        "leaves the range": ("[0] + [B] * W", "[0] + [2 * B] * W"),
        "is too short": ("[0] + [B] * W", "[0] + [B] * (W - 1)"),
    },
    "ex-lab-late": {
        "does not wait": ("errs[t - delay]", "errs[t - 1]"),
        "waits one step too long": ("t >= delay", "t > delay"),
        "hears a step too early": (
            "if t >= delay:\n            q = q + eta * (errs[t - delay] - alpha)",
            "if t >= max(delay - 1, 1):\n"
            "            q = q + eta * (errs[t - max(delay - 1, 1)] - alpha)",
        ),
        "counts a tie as an error": ("s > q", "s >= q"),
        "takes turns": (
            "q, errs = 0, []\n    for t, s in enumerate(scores):\n"
            "        if t >= delay:\n            q = q",
            "errs, all_q = [], [0] * delay\n    for t, s in enumerate(scores):\n"
            "        q = all_q[t % delay]\n"
            "        if t >= delay:\n            q = all_q[t % delay] = q",
        ),
    },
    "ex-lab-closeness": {
        "is one half at contact": ("return 2 / (1", "return 1 / (1"),
        "grows with the distance": ("math.exp(0.1 * l)", "math.exp(-0.1 * l)"),
        "inverts with the wrong sign": (
            "10 * math.log((2 - closeness)",
            "-10 * math.log((2 - closeness)",
        ),
        "inverts a sigmoid": ("(2 - closeness) / closeness", "(1 - closeness + 1e-12) / closeness"),
        "mistakes the unit": ("10 * math.log", "math.log"),
    },
    "ex-lab-switch": {
        "is fast at equality": (">= q_safe", "> q_safe"),
        "is the baseline without a quantile": (
            "np.asarray(l_hat) + np.asarray(q) >=",
            "np.asarray(l_hat) >=",
        ),
        "looks at the lower end": ("np.asarray(l_hat) + np", "np.asarray(l_hat) - np"),
        "exchanges the policies": ("safe, fast)\n    # END", "fast, safe)\n    # END"),
        "takes one action for all roads": (">= q_safe, safe, fast", ">= q_safe, safe[0], fast[0]"),
    },
    "ex-lab-watch": {
        "brakes for cars behind": ("(x > 0) & ", ""),
        "brakes for cars of other lanes": (" & (np.abs(y) < 0.125)", ""),
        "brakes for empty rows": ("(here > 0.5) & (x > 0) & (x < gap)", "(x < gap) & (x >= 0)"),
        "looks at the nearest row only": ("close.any(axis=1)", "close[:, 0]"),
        "exchanges the actions": ("4, 3)\n    # END", "3, 4)\n    # END"),
        "counts itself": ("obs[:, 1:, i]", "obs[:, :, i]"),
        "does not look to the right": ("np.abs(y) < 0.125", "(y < 0.125) & (y >= 0)"),
    },
    "ex-lab-gain": {
        "has no rule against false positives": (" and not false_positive", ""),
        "needs one of the two conditions": ("0.8 and l_hat + q > 1.1", "0.8 or l_hat + q > 1.1"),
        "forgets to clip": (
            "min(max(kp * (0.8 if slow else 1.1), low), high)",
            "kp * (0.8 if slow else 1.1)",
        ),
        "speeds up at equality": ("l_hat + q >= 0.8", "l_hat + q > 0.8"),
        "clips before it multiplies": (
            "min(max(kp * (0.8 if slow else 1.1), low), high)",
            "min(max(kp, low), high) * (0.8 if slow else 1.1)",
        ),
    },
    "ex-lab-signs": {
        "is one-sided": (
            "abs(sum(e * d for e, d in zip(es, differences, strict=True)))",
            "sum(e * d for e, d in zip(es, differences, strict=True))",
        ),
        "does not count the observed pattern": ("value >= seen", "value > seen"),
        "counts signs and no sizes": ("e * d for", "e * (d > 0) for"),
        "is a probability of equality": ("value >= seen", "value == seen"),
    },
    "ex-lab-kinds": {
        "has one threshold": ("q.get(kind, 0)", "q.get(0, 0)"),
        "moves all thresholds": (
            "q[kind] = level + eta * (errs[-1] - alpha)",
            "q = {k: q.get(k, 0) + eta * (errs[-1] - alpha) for k in kinds}",
        ),
        "counts a tie as an error": ("s > level", "s >= level"),
        "has the sign of the paper": ("level + eta", "level - eta"),
    },
}

CASES = [
    pytest.param(label, *change, id=f"{label}: {why}")
    for label, changes in WRONG.items()
    for why, change in changes.items()
]


def wrong(label, old, new):
    """Return the reference with a part exchanged; wrong answers to other questions are none."""
    answer = QUESTIONS[label][1].answer
    assert answer.count(old) == 1, f"{old!r} does not stand once in the reference of {label}"
    return answer.replace(old, new)


def test_every_code_exercise_has_at_least_three_wrong_answers():
    assert set(WRONG) == set(QUESTIONS)
    assert min(len(changes) for changes in WRONG.values()) >= 3


@pytest.mark.parametrize("name", LABS)
def test_references_reach_all_points_and_stubs_none(name):
    questions = questions_of(LABS[name])
    full = mark(LABS[name], {q.label: q.answer for q in questions})
    assert {label: m.said for label, m in full.items() if m.points != m.possible} == {}
    none = mark(LABS[name], {})
    assert {label: m.points for label, m in none.items()} == dict.fromkeys(none, 0)


@pytest.mark.parametrize(("label", "old", "new"), CASES)
def test_a_wrong_answer_is_caught(label, old, new):
    name = QUESTIONS[label][0]
    answers = {q.label: q.answer for q in questions_of(LABS[name])}
    made = mark(LABS[name], {**answers, label: wrong(label, old, new)})
    assert made[label].points < made[label].possible
    others = {other: m for other, m in made.items() if other != label}
    assert all(m.points == m.possible for m in others.values()), "only this one is wrong"


def test_an_answer_that_does_not_run_has_no_points_and_does_no_harm_to_others():
    lab = LABS["lab_tracker"]
    answers = {q.label: q.answer for q in questions_of(lab)}
    made = mark(lab, {**answers, "ex-lab-follow": "def follow(:"})
    assert made["ex-lab-follow"].points == 0
    assert made["ex-lab-follow"].said[0].startswith("SyntaxError")
    assert made["ex-lab-pinball"].points == made["ex-lab-pinball"].possible


@pytest.mark.parametrize("name", LABS)
def test_the_masters_references_resolve_and_hidden_checks_are_marked(name):
    notebook = json.loads(master(LABS[name], targets_of(pages_of(ROOT))))
    texts = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "markdown"]
    text = "\n".join(texts)
    assert "{ref}" not in text
    assert "```{" not in text
    assert text.count("### Exercise: ") == len(questions_of(LABS[name]))
    codes = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    hidden = sum(check.hidden for q in questions_of(LABS[name]) for check in q.checks)
    assert sum("hidden: true" in code for code in codes) == hidden >= 3


@pytest.mark.rehearsal
@pytest.mark.parametrize("name", LABS)
def test_otter_grades_reference_stubs_and_wrong_answers(name, tmp_path):
    """The whole way: assign, hand in, grade; all wrong answers, one notebook for each round."""
    questions = questions_of(LABS[name])
    made = assign(LABS[name], targets_of(pages_of(ROOT)), tmp_path / "labs", check=True)
    student = made.student.read_text()
    assert "SOLUTION" not in student
    full = grade(made.grader, made.reference)
    assert full.points == full.possible == {q.name: float(len(q.checks)) for q in questions}
    assert grade(made.grader, made.student).total == 0
    changes = {q.label: list(WRONG[q.label].values()) for q in questions}
    for round_ in range(max(len(found) for found in changes.values())):
        answers = {
            q.label: wrong(q.label, *changes[q.label][round_ % len(changes[q.label])])
            for q in questions
        }
        handed_in = tmp_path / f"round{round_}" / made.student.name
        handed_in.parent.mkdir()
        handed_in.write_text(filled(student, questions, answers))
        scores = grade(made.grader, handed_in)
        too_good = {n: p for n, p in scores.points.items() if p >= scores.possible[n]}
        assert too_good == {}, f"round {round_}"


def filled(notebook, questions, answers):
    """Return the student's notebook with answers in place of the stubs."""
    content = json.loads(notebook)
    stubs = {q.stub.strip(): answers[q.label] for q in questions}
    seen = 0
    for cell in content["cells"]:
        source = "".join(cell["source"]).strip()
        if source in stubs:
            cell["source"] = stubs[source]
            seen += 1
    assert seen == len(questions)
    return json.dumps(content)
