"""Random pairs of surfaces of every kind pass a constant pressure on."""

from contactopt.coupling import coupling
from experiments.questions.patch_test.judge import EXACT, judge
from experiments.questions.patch_test.pairs import MAKERS, pair


def test_a_pair_of_every_kind_is_right():
    found = [judge(seed, pair(seed)) for seed in range(len(MAKERS))]
    assert not [one for one in found if one.wrong or one.said]
    assert {one.coupling for one in found} == {"matching", "mortar"}
    assert max(max(one.forces, one.pressure) for one in found) < EXACT


def test_the_harness_finds_nodes_joined_without_their_facets(monkeypatch):
    monkeypatch.setattr(coupling, "misfit", lambda *asked: None)
    found = [judge(seed, pair(seed)) for seed in (14, 38, 56)]
    assert all(one.wrong and one.coupling == "matching" for one in found)
    assert all(one.pressure > 0.1 for one in found[:2])
