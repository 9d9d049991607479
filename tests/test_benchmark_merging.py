"""Rows of others: certificates are recomputed, machines are not mixed, shards are one campaign."""

import json
import logging
import shutil

import numpy as np
import pytest

from contactopt import InputError
from contactopt.benchmark.merging import joined
from contactopt.benchmark.ranking import factors, leader_table, points
from contactopt.benchmark.store import ANSWERS, answers, load, save
from tests.test_ranking import rows

pd = pytest.importorskip("pandas")


def theirs(campaign, folder, changed=lambda table: table, answered=lambda found: found):
    """A table of others, who say that it is theirs."""
    shutil.copy(campaign / "rows.jsonl", folder / "not-a-table")
    save(changed(load(campaign).assign(experiment="theirs")), folder / "forged.csv")
    np.savez(folder / ANSWERS, **answered(answers(campaign)))
    return folder / "forged.csv"


def easier(table):
    """The parameters of a problem with other friction, under the label of a hard one."""
    return table.assign(parameters=table["parameters"].str.replace("0.5", "0.25"))


FORGED = {
    "zeros": (dict(answered=lambda found: {k: 0 * a for k, a in found.items()}), "", 0),
    "no answers": (dict(answered=lambda _: {}), "no answer travels", 12),
    "a wrong size": (dict(answered=lambda found: {k: a[:1] for k, a in found.items()}), "fit", 12),
    "text": (dict(answered=lambda found: {k: "x" for k in found}), "fit", 12),
    "another problem": (dict(changed=easier), "not what its parameters say", 4),
    "a plug-in": (
        dict(changed=lambda t: t.assign(family="mine", problem="mine", parameters="{}")),
        "problem of a plug-in",
        12,
    ),
    "no parameters": (dict(changed=lambda t: t.assign(parameters="[")), "0 certificates", 12),
}


@pytest.mark.parametrize("forgery", FORGED)
def test_a_forged_table_is_not_believed(campaign, tmp_path, forgery):
    given, words, left_out = FORGED[forgery]
    table, said = joined(campaign, [theirs(campaign, tmp_path, **given)])
    others = table[table["source"] == "forged"]
    assert len(others) == 12 - left_out
    assert sum(words in sentence for sentence in said if words) == (1 if words else 0) or left_out
    assert not words or words in " ".join(said)
    if forgery == "zeros":
        assert not others["success"].any() and set(others["status"]) == {"false_claim"}
        assert (others["residual"] > 1e-3).all() and "12 of these rows claimed" in said[0]


def test_honest_rows_get_the_certificates_that_they_had_and_limits_of_ours(campaign, tmp_path):
    raised = theirs(campaign, tmp_path, lambda t: t.assign(residual=1e-20, time_limit=1e9))
    table, said = joined(campaign, [raised])
    assert len(table) == 24 and len(said) == 1 and "12 certificates" in said[0]
    own, others = (rows for _, rows in table.groupby("source", sort=False))
    np.testing.assert_allclose(others["residual"], own["residual"], rtol=1e-12)
    assert others["success"].all() and set(table["time_limit"]) == {10.0}
    assert set(others["method"]) == {"auto (forged)", "nsgs (forged)"}
    (tmp_path / ANSWERS).write_text("no answers")
    with pytest.raises(InputError, match="cannot read the answers"):
        joined(campaign, [raised])


WRONG = {"residual": "small", "contacts": "1.5", "success": "maybe"}


@pytest.mark.parametrize("column", WRONG)
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_row_of_a_wrong_type_costs_only_itself(campaign, tmp_path, caplog, kind, column):
    table, path = load(campaign), tmp_path / f"rows.{kind}"
    table[column] = table[column].astype(str)
    table.loc[2, column] = WRONG[column]
    save(table, path)
    with caplog.at_level(logging.WARNING):
        found = load(path)
    assert list(found["key"]) == list(table["key"].drop(index=2))
    place = "line 4" if kind == "csv" else "row 3"
    assert f"'{path}', {place}: its '{column}' is not " in caplog.text
    pd.testing.assert_series_equal(found["residual"], load(campaign)["residual"].drop(index=2)
                                   .reset_index(drop=True), rtol=1e-5)  # fmt: skip


def test_a_line_with_too_many_fields_costs_only_itself(campaign, tmp_path, caplog):
    path = tmp_path / "rows.csv"
    save(load(campaign), path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:3], lines[3] + ",one,more", *lines[4:]]) + "\n")
    with caplog.at_level(logging.WARNING):
        assert len(load(path)) == 11
    assert "line 4" in caplog.text


def on(machine, method, seconds, calibration, problem="p"):
    """Runs on a machine: `seconds` of the repeats."""
    made = [row for t in seconds for row in rows(method, [(1e-6, 1e-7, t)], problem)]
    known = dict(name=method, settings="{}", success=True, machine=machine, calibration=calibration)
    return pd.DataFrame(made).assign(**known)


def test_machines_are_ranked_together_only_with_a_factor_that_was_measured():
    """B is twice as slow as A by its calibration, and three times by the runs made on both."""
    a = pd.concat([on("A", name, [0.1, 0.1, 0.1], 0.02) for name in ("one", "two")])
    other = on("B", "three", [0.3], 0.04)
    common = pd.concat([a, other, on("B", "one", [0.3], 0.04)])
    assert factors(common)["B"][0] == pytest.approx(3.0)
    cpu = points(common).set_index("method")["cpu"]
    assert cpu["three"] == pytest.approx(0.1) and "rank (95 %)" in leader_table(common)
    assert np.isnan(factors(pd.concat([a, other]))["B"][0])
    assert "rank (95 %)" not in leader_table(pd.concat([a, other]))
    elsewhere = [on("B", name, [0.4], 0.04, "q") for name in ("one", "two")]
    assert factors(pd.concat([a, *elsewhere]))["B"][0] == pytest.approx(2.0)
    unknown = pd.concat([a, *(one.assign(calibration=np.nan) for one in elsewhere)])
    found = leader_table(unknown)
    assert not {"rank (95 %)", "over the least"} & {*found}
    assert found["method"].is_monotonic_increasing
    assert not factors(a)


def test_a_row_has_the_card_and_the_calibration_of_its_machine(campaign):
    rows = [json.loads(line) for line in (campaign / "rows.jsonl").read_text().splitlines()]
    assert {"cores" in row["machine"] and "GB" in row["machine"] for row in rows} == {True}
    assert len({row["calibration"] for row in rows}) == 1 and 1e-3 < rows[0]["calibration"] < 10
