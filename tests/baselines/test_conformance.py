"""Every registered method keeps every promise of the protocol."""

import subprocess
import sys

import pytest

from baselines import registry
from parapoint.method import MissingError
from parapoint.testing import check_method

COPY = (  # an external program: every vertex to its x and y
    f'{sys.executable} -c "import sys; p = [l.split() for l in open(sys.argv[1])]; '
    "v = [w for w in p if w[0] == 'v']; f = [w[1:] for w in p if w[0] == 'f']; "
    "open(sys.argv[2], 'w').write(''.join('v ' + ' '.join(w[1:]) + chr(10) for w in v)"
    " + ''.join('vt ' + ' '.join(w[1:3]) + chr(10) for w in v)"
    " + ''.join('f ' + ' '.join(i + '/' + i for i in w) + chr(10) for w in f))\""
    " {input} {output}"
)
ARGUMENTS = {
    "computed": {"points": 150},
    "meshed": {"reconstruction": "ball_pivoting"},  # the faster one
    "textured": {"texels": 64},
    "external": {"command": COPY},
    "fam": {"points": 120, "subset": 100, "iterations": 2},
    "foldingnet": {"points": 120, "subset": 100, "iterations": 2},
    "atlasnet": {"points": 120, "subset": 100, "iterations": 2, "charts": 2},
    "diffsr": {"points": 120, "subset": 100, "iterations": 2, "charts": 2},
    "elestruc": {"points": 120, "subset": 100, "iterations": 2, "charts": 2},
    "gtif": {"points": 120, "subset": 100, "iterations": 2},
    "tearingnet": {"points": 120, "subset": 100, "iterations": 2},
    "nsm": {"points": 120, "subset": 100, "iterations": 4},
    "flattening_net": {"points": 120, "subset": 100, "iterations": 2},
    "reggeonet": {"points": 120, "subset": 100, "iterations": 2},
    "nuvo": {"points": 120, "subset": 100, "iterations": 2},
    "geometry_image": {"side": 17},
    "smith_schaefer": {"iterations": 60},
    "parapoint": {"points": 120, "subset": 100, "iterations": 3, "threads": 1, "device": "cpu"},
}


def method(name):
    spec = ", ".join(f"{key}={value!r}" for key, value in ARGUMENTS.get(name, {}).items())
    return registry.method(f"{name}({spec})")[1]


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(registry.METHODS.keys() - {"meshlab_voronoi"}))
def test_registered_method_conforms(name):
    try:
        check_method(method(name))
    except MissingError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("energy", ["conformal", "log_arap", "exp_conformal"])
def test_each_energy_of_slim_conforms(energy):
    check_method(registry.method(f"slim(energy={energy}, iterations=5)")[1])


def test_meshlab_voronoi_repeats_its_map_in_a_fresh_process_only():
    pytest.importorskip("pymeshlab")
    with pytest.raises(AssertionError, match="another map under the same seed"):
        check_method(method("meshlab_voronoi"))
    code = (
        "from baselines import registry; from parapoint.testing import sphere; "
        "made = registry.method('meshlab_voronoi')[1].parameterize(sphere(), seed=0); "
        "print(made.uv.tobytes().hex())"
    )
    runs = [subprocess.check_output([sys.executable, "-c", code]) for _ in range(2)]
    assert runs[0] == runs[1]
