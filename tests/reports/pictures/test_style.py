"""How figures are laid out."""

from types import SimpleNamespace

import pytest

from reports.labels import Label
from reports.pictures.style import COLOURS, OURS, legend_below, look, small_multiples


@pytest.mark.parametrize("methods", [1, 4, 13])
def test_a_legend_lies_below_the_labels_of_the_panels(methods):
    made, places = small_multiples(6)
    before = [place.get_window_extent().height for place in places]
    for number in range(methods):
        places[0].plot([0, 1], [0, 1], label=f"a method with a long name, the {number}th")
    for place in places:
        place.set_xlabel("area discrepancy")
    legend_below(made, places)
    top = made.legends[0].get_window_extent().y1
    assert all(place.get_tightbbox().y0 >= top - 1e-6 for place in places)
    after = [place.get_window_extent().height for place in places]
    assert after == pytest.approx(before)  # the figure grows, its panels stay


@pytest.mark.parametrize(("others", "ours"), [(30, 3), (0, 9), (3, 1)])
def test_no_two_methods_look_alike_and_ours_are_vermilion_beside_others(others, ours):
    methods = [("lscm", f"other {number}") for number in range(others)]
    methods += [("parapoint", f"ours {number}") for number in range(ours)]
    labels = [Label(method, "{}", method, "", short) for method, short in methods]
    looks = [look(SimpleNamespace(methods=labels), label) for label in labels]
    assert len({tuple(map(str, one.values())) for one in looks}) == len(labels)
    colours = [one["color"] for one in looks]
    assert OURS not in colours[:others]
    assert colours[:others][:9] == list(COLOURS[: min(others, 9)])
    expected = {OURS} if others else {OURS, *COLOURS[:8]}
    assert set(colours[others:]) == expected
    assert looks[others] == {"color": OURS, "linestyle": "-", "marker": "*"}
