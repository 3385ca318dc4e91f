'''The methods that ParaPoint is compared with, and how to add one.

A method is one small dataclass. Its fields are its hyperparameters, its docstring says whose it is,
`requires` says what a surface must be (words of `parapoint.method.REQUIREMENTS`), and
`parameterize` maps a surface. This is a whole one, the file `planar.py`:

    """Projection to a plane."""
    from dataclasses import dataclass
    from typing import ClassVar

    import numpy as np
    from parapoint import Parameterization


    @dataclass(frozen=True)
    class Planar:
        """Orthogonal projection to the plane of largest variance (K. Pearson 1901)."""

        scale: float = 1.0
        requires: ClassVar[frozenset[str]] = frozenset({"faces"})

        def parameterize(self, surface, *, seed):
            used = surface.vertices[np.unique(surface.faces)]
            axes = np.linalg.svd(used - used.mean(axis=0), full_matrices=False)[2][:2]
            return Parameterization(self.scale * surface.vertices @ axes.T, surface.faces)

Run it, as it is or with other parameters:

    python -m benchmarks run smoke --plugin planar.py:Planar --methods planar,slim
    python -m benchmarks run smoke --plugin planar.py:Planar --methods "planar(scale=2)"

Check it: `parapoint.testing.check_method(Planar())` raises at the first promise that is broken.

To share it, put this `pyproject.toml` beside it; wherever the folder is installed (`pip install
./planar`), `planar` is then a method like any other:

    [project]
    name = "planar"
    version = "1.0"

    [project.entry-points."parapoint.methods"]
    planar = "planar:Planar"

What a method may count on, and what it must keep:

- A mesh is manifold, oriented, connected, ... only if `requires` says so. One that is not is made
  so, the same way for every method (`parapoint.surfaces.preparation`): its components come in turn,
  and with `disk_after_cut` closed ones and those with handles come cut to a disk, disks with holes
  as they are. With `disk`, what is no disk is not handed over, and its row is `skipped`.
- Vertices may be duplicate or unreferenced, triangles thin, scales any. Arrays are read-only.
- The result has one row of `corners` for each face, in order; a row of `uv` belongs to one place
  of the surface. Scale, rotation and mirrored charts are free.
- Every random draw comes from `seed`: the same cell gives the same map, bit by bit, on one
  machine. A method that cannot promise it says `deterministic: ClassVar[bool] = False`.
- Only `parameterize` is timed: import libraries at the top of the file, and what takes seconds to
  import or start in a method `preload(self)`, which is called before the clock. One that need not
  be installed is imported by `baselines.tools.optional.optional`, so that its rows are `skipped`,
  say what to install, and are tried again by the next run.
- Raise `UnsupportedError` for what the method cannot take though `requires` admits it (`skipped`);
  any other error is a `failed` row with its message.
- `trace` may hold energies and maps on the way; `report` what should stand beside the result.
- `packages` names the libraries whose versions are part of the method: results are run anew when
  one changes, as they are when the method's own source does, or that of what it imports from its
  own package or from this project.
- `licence` names that of what runs, `citation` what to cite, as an entry of BibTeX: the report says
  the one and gathers the other in `methods.bib`.

A program that reads and writes OBJ files needs no code; it is run by
`external(command="tool {input} {output}")`.

A method of this package is a file here and a line in `baselines.registry.METHODS`; whom to credit
for it stands in `baselines.credits`.
'''
