"""The report of what a frame costs besides its time, from made-up records."""

from helpers.experiment_records import csv_of, record_of, report_of
from shadowbench.experiments.costs import METHODS
from shadowbench.harness.report import document
from shadowbench.harness.report.page.gather import with_texts

KNOWN = {"energy_j": 0.05, "idle_w": 75.0, "alone_ms": 0.5, "pair_ms": 0.4, "missing": {}}
NONE = {"energy_j": None, "idle_w": None, "alone_ms": None, "pair_ms": None,
        "missing": {"energy": "no counter", "in flight": "it is not captured in a graph"}}  # fmt: skip


def test_the_table_has_every_cost_and_says_why_one_is_missing(tmp_path):
    first, second, third = METHODS[0], METHODS[3], METHODS[-2]
    made = [record_of("costs", entry, ms=0.5) for entry in (first, second, third)]
    made[0]["frames"][0] |= {"costs": [KNOWN], "counters": {"primary tests": 8192}}
    quality = {"expected nodes a hundred rays": 2000, "expected tests a hundred rays": 300}
    made[1]["frames"][0] |= {"costs": [{**KNOWN, "energy_j": 0.1, "pair_ms": 0.5}], "counters": quality}
    made[2]["frames"][0] |= {"costs": [NONE]}
    text = report_of("costs", tmp_path, made)
    assert (
        f"A frame of {first.label} takes the least energy, 50.0 mJ above idle, and one of {second.label} the most"
        in text
    )
    assert f"helps {second.label} the least: 1.00 times" in text
    assert f"{first.label} the most: 1.25 times" in text
    assert "above its idle power, 75 W on Imaginary GPU" in text
    assert f"No energy of {third.label}: no counter." in text
    assert f"No second frame in flight of {third.label}: it is not captured in a graph." in text
    rows = {row["label"]: row for row in csv_of("costs", tmp_path)}
    assert float(rows[first.label]["watts"]) == 75.0 + 50.0 / 0.5
    assert float(rows[first.label]["primary_tests"]) == 2.0
    assert float(rows[second.label]["sah_cost"]) == 1.2 * 20 + 3
    assert f"No triangle tests of primary rays counted: {second.label}; {third.label}." in text
    assert f"No triangle tests of shadow rays counted: {second.label}; {first.label}; {third.label}." in text
    page = with_texts(document.read(tmp_path)).set_index("label")
    shown = [f"text.{name}" for name in ("energy_mj", "idle_w", "bytes_per_ray", "expected_tests", "sah_cost")]
    assert page.loc[second.label, shown].tolist() == ["100", "75.0", "0.000", "3.00", "27.0"]
    assert page.loc[first.label, "text.primary_tests"] == "2.00"
    (line,) = (line for line in text.splitlines() if line.startswith(f"| Cloth (stand-in) | {first.label} |"))
    assert line.split(" | ")[4:] == ["50.0", "175", "0.000", "0", "2,000", "2,500", "2.00", "-", "-", "- |"]


def test_energy_above_a_card_that_was_not_idle_is_none(tmp_path):
    first, second = METHODS[0], METHODS[3]
    made = [record_of("costs", entry, ms=0.5) for entry in (first, second)]
    made[0]["frames"][0] |= {"costs": [{**KNOWN, "idle_w": 327.0}]}
    made[1]["frames"][0] |= {"costs": [KNOWN]}
    text = report_of("costs", tmp_path, made)
    assert f"No energy of {first.label}: something else used the card while it should have been idle." in text
    rows = {row["label"]: row for row in csv_of("costs", tmp_path)}
    assert (rows[first.label]["energy_mj"], rows[first.label]["watts"]) == ("", "")
    assert float(rows[second.label]["watts"]) == 175.0
    assert "above its idle power, 75 W on Imaginary GPU" in text
