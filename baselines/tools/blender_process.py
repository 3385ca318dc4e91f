"""The other side of `blender.py`: a script for an interpreter that has bpy; it is not imported.

It says on standard output that it is ready, takes one task (a JSON object on a line of standard
input), answers with a JSON object on a line, and ends. Arrays travel in the files that are named.
"""

import json
import os
import sys
import time


def main() -> None:
    """Say {"blender": version} or {"missing": why}, do the task, say how it went."""
    # Blender prints to standard output; the answers go where it cannot follow.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    try:
        import bpy
    except ImportError as error:
        answers.write(json.dumps({"missing": str(error)}) + "\n")
        return
    answers.write(json.dumps({"blender": bpy.app.version_string}) + "\n")
    line = sys.stdin.readline()
    if line:
        try:
            answer: dict[str, object] = {"seconds": unwrap(**json.loads(line))}
        except ValueError as error:
            answer = {"unsupported": str(error)}
        except Exception as error:  # noqa: BLE001 (whatever Blender raises is the answer)
            answer = {"error": " ".join(str(error).split())}
        answers.write(json.dumps(answer) + "\n")
    answers.flush()
    os._exit(0)  # Blender's way out takes longer and may crash


def unwrap(source: str, target: str, operator: str, options: dict[str, object]) -> float:
    """Unwrap a mesh; the seconds that Blender's operator took.

    Args:
        source: .npz file with vertices (V, 3) and faces (F, 3).
        target: .npy file to be written: (F, 3, 2), uv of each corner.
        operator: name in `bpy.ops.uv`.
        options: its arguments.

    Raises:
        ValueError: Blender's check of the mesh changed it.
        RuntimeError: the operator failed.
    """
    import bpy
    import numpy as np

    arrays = np.load(source)
    vertices, faces = arrays["vertices"], arrays["faces"]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("mesh")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    if mesh.validate():  # what it would not take could end the whole process
        raise ValueError(
            "Blender takes no mesh with two faces on the same vertices, or a vertex twice in a face"
        )
    mesh.uv_layers.new(name="uv")
    thing = bpy.data.objects.new("thing", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    began = time.perf_counter()
    ended = getattr(bpy.ops.uv, operator)(**options)
    seconds = time.perf_counter() - began
    if "FINISHED" not in ended:
        raise RuntimeError(f"{operator} ended with {', '.join(ended)}")
    bpy.ops.object.mode_set(mode="OBJECT")
    uv = np.empty(2 * faces.size, dtype=np.float32)
    mesh.uv_layers["uv"].uv.foreach_get("vector", uv)
    np.save(target, uv.reshape(-1, 3, 2))
    return seconds


main()
