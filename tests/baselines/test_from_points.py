"""The grades know which methods see points alone."""

from baselines import registry
from benchmarks.metrics.grades import FROM_POINTS


def test_a_method_that_needs_no_faces_is_graded_as_one_of_points():
    needs = {name: set(registry.describe(name).requires) for name in registry.METHODS}
    assert {name for name in needs if not needs[name] & {"faces", "seams"}} == FROM_POINTS
