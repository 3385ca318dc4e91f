"""How figures are laid out."""

import pytest

from reports.pictures.style import legend_below, small_multiples


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
