"""Tables and sentences of hand-made changes, word by word, on the terminal and on the page."""

import pytest

from docs.make.accuracy_and_cost.answers import AskedStudy, head, section
from dsa_des.answers.models_in_turns import TurnTimes
from dsa_des.answers.report import AnswerReport
from dsa_des.answers.verdicts import Limit
from tests.answers.test_models_that_may_be_taken import RANGE, change

MODELS = {
    "near": change(-5.0, 15.0, count=60),
    "twin": change(0.0, 0.0, count=60, differing=0),
    "far": change(300.0, 500.0, count=60, lost=7, at=()),
    "wide": change(-200.0, 240.0, count=60, neither=2, cut_off=3),
    "broken": None,
}


@pytest.fixture
def report() -> AnswerReport:
    times = TurnTimes()
    for turn in range(3):
        for model, cpu_s in enumerate((0.6, 0.3, 0.594, 0.9, 0.33)):
            times.cpu_s[turn, model], times.runs[turn, model] = cpu_s, 20
    changes = [
        type(one)(**{**vars(one), "model": name}) for name, one in MODELS.items() if one is not None
    ]
    return AnswerReport(
        title="a study", unit="replicas", axes=[], models=list(MODELS), results=[RANGE],
        limits={"range_m": Limit(0.1, True)}, confidence=0.95, comparisons=5, changes=changes,
        turn_times=times, failed={"broken": "it broke"}, own=["radar detection: exact"],
        unavailable=[("radar: a", "needs a table"), ("radar: b", "needs a table")], notes=["so"],
    )  # fmt: skip


def test_the_sentences_decide_first_and_name_everyone(report: AnswerReport) -> None:
    assert report.conclusion_sentences("range_m") == [
        "With the scene as it is range_m, m, is 1000 (1000 to 1000), of 60 replicas.",
        "May be taken without changing it by more than 10 % of it (100 m), 95 % sure of all, each "
        "alone: 2 of 5 models.",
        "The cheapest is near, at 0.5 of the scene's CPU. Front, cheapest first: near (0.5, at "
        "most 15 m); as it is.",
        "Within it: near (+5 ± 10 m, 0.5 of the CPU).",
        # 60 runs without one that differs, at 99 %: at most ln(100) / 60 = 1 in 13.03.
        "The same in every run, each of 60 here (as sure: at most 1 in 13 would differ): twin "
        "(0.99 of the CPU).",
        "Surely changed by more than 10 % of it (100 m), or no longer there: far (+400 ± 100 m).",
        # What the run cut off may have changed by more: no number of replicas tells.
        "Not told by so many replicas: wide (+20 ± 220 m, 3 of 60 cut off where the run begins or "
        "ends).",
        "Not compared: broken (it broke).",
    ]


def test_the_table_has_a_line_for_each_model(report: AnswerReport) -> None:
    rows = {row[0]: row[1:] for row in report.table_rows("range_m")}
    assert rows["as it is"][0] == "30 ms a run"
    assert rows["near"] == ["0.5", "5", "-5 to 15", "", "60 of 60", "within, front"]
    assert rows["twin"][-2:] == ["0 of 60", "same"]
    assert rows["far"][-1] == "beyond; 7 of 60 have no value with it"
    assert rows["wide"][-1] == (
        "open; 2 without a value with either; 3 cut off by the run, which may hide more"
    )
    assert rows["broken"][-1] == "nothing to compare: it broke"
    files = {row["model"]: row for row in report.rows()}
    assert files["wide"]["wanted"] is None and files["near"]["wanted"] is None
    assert files["broken"] == {"result": "range_m", "model": "broken",
                               "verdict": "nothing to compare", "reason": "it broke"}  # fmt: skip


def test_what_holds_for_all_is_said_once(report: AnswerReport) -> None:
    said = report.notes_on_tables()
    assert "each of the 5 is a paired difference" in said[0] and "at 99 % (Bonferroni)" in said[0]
    assert "median of 3 turns" in said[1]
    assert said[2:] == [
        "The scene as it is: radar detection: exact.",
        "Not available here: radar: a, radar: b (needs a table).",
        "Note: so.",
    ]


def test_a_page_says_what_the_command_says(report: AnswerReport) -> None:
    asked = AskedStudy("Ranges", "mine", ("range_m",), ("replicas=60",), budgets=("10%",))
    page = section([report], [asked])
    assert "`dsa-des cost mine --answer range_m --set replicas=60 --budget 10%`" in page
    first, *said = report.conclusion_sentences("range_m")
    # Which may be taken, the cheapest and those that change it stand in the head and in the table,
    # and those with which no run differs in a line of its own.
    shown = [one for one in said if one not in page]
    assert [one.split()[0] for one in shown] == ["May", "The", "Within", "The", "Surely"]
    assert first in page and all(sentence in page for sentence in report.notes_on_tables())
    assert "| near | 0.5 | 5 | -5 to 15 | 60 of 60 | within, front |" in page
    decision = " ".join(report.conclusion_sentences("range_m")[1:3]).partition(" Front,")[0]
    assert head([report], [asked]) == f"- **Ranges**, `range_m`. {decision}"


def test_where_nothing_is_near_enough_that_is_said(report: AnswerReport) -> None:
    report.limits["range_m"] = Limit(1e-6, False)
    report.changes = [one for one in report.changes if one.model != "twin"]
    report.__post_init__()
    said = report.conclusion_sentences("range_m")
    assert said[1] == "No model is surely within 1e-06 m."
