"""How public programs are called, by name: `external(recipe=optcuts)`.

Each recipe follows the program's own documentation. The tests run stand-ins that write what is said
there; the programs themselves have not been run.
"""

from __future__ import annotations

from typing import NamedTuple


class Recipe(NamedTuple):
    """A program's command line.

    Attributes:
        command: split as a shell would; {input} is the OBJ file that it reads, {output} the one
            that it writes, {folder} an empty folder for what it writes beside.
        source: where to get the program, and what must be there besides.
        follows: the documentation that the command follows.
        result: pattern of the file with the map, in {folder}, where the program names it itself;
            "" where it writes {output}.
        home: environment variable that names the program's own folder, in which it must be
            started; "" where it is found on the PATH and started in {folder}.
    """

    command: str
    source: str
    follows: str
    result: str = ""
    home: str = ""


RECIPES = {
    "optcuts": Recipe(
        "OptCuts_bin 100 {input} 0.999 1 0 4.1 1 0",
        "build https://github.com/liminchen/OptCuts and put build/OptCuts_bin on the PATH",
        "README at 1f4168f: without a window, bound 4.1 on the symmetric Dirichlet energy, "
        "one to one. It cuts for itself; takes one connected component.",
        result="output/*/finalResult_mesh.obj",
    ),
    "bff": Recipe(
        "bff-command-line {input} {output}",
        "build https://github.com/GeometryCollective/boundary-first-flattening and put "
        "bff-command-line on the PATH",
        "README of 1.2, CommandLine.cpp at 127e0b5. It cuts what is no disk, a closed surface at 8 "
        "cones; vertices and faces keep their order.",
    ),
    "uvatlas_tool": Recipe(
        "uvatlastool -nologo -y -wf -o {output} {input}",
        "get uvatlastool from the releases of https://github.com/microsoft/UVAtlas",
        "its usage text, with -wf for OBJ. It makes charts and repeats vertices at seams.",
    ),
    "surface_nvp": Recipe(
        "python scripts/train_injective_nvp.py --input {input} --output {output} --iters 1000",
        "clone https://github.com/Yomeko1/surface-nvp-parameterization, install its requirements "
        "for the python of the PATH, and set SURFACE_NVP to its folder",
        "README of 2.0. It takes one disk with one boundary, and does not cut.",
        home="SURFACE_NVP",
    ),
    "partuv": Recipe(
        "python demo/partuv_demo.py --mesh_path {input} --output_path {folder} "
        "--pack_method blender",
        "clone https://github.com/EricWang12/PartUV with its checkpoint, install partuv and bpy "
        "for the python of the PATH, and set PARTUV to its folder",
        "README at 46bad07. It needs CUDA, makes charts, merges close vertices, and writes faces "
        "part by part.",
        result="**/final_packed.obj",
        home="PARTUV",
    ),
}
"""By name."""
