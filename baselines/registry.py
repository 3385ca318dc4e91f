"""The methods by name: the built-in table, installed plugins, and files given for one run.

Only what is asked for is imported: looking up one method leaves the libraries of all others, and
torch, alone.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import importlib
import importlib.util
import re
import sys
import types
from collections.abc import Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass
from difflib import get_close_matches
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from baselines.credits import CREDITS, cited
from parapoint import sources
from parapoint.errors import InputError
from parapoint.method import REPAIRED, REQUIREMENTS, Method
from parapoint.parameters import LARGEST_SEED

METHODS: dict[str, str] = {
    "tutte": "baselines.disks.tutte:Tutte",
    "harmonic": "baselines.disks.harmonic:Harmonic",
    "mean_value": "baselines.disks.mean_value:MeanValue",
    "lscm": "baselines.disks.lscm:LSCM",
    "abf": "baselines.disks.abf:ABF",
    "arap": "baselines.disks.arap:ARAP",
    "slim": "baselines.disks.slim:SLIM",
    "smith_schaefer": "baselines.disks.smith_schaefer:SmithSchaefer",
    "geometry_image": "baselines.disks.geometry_image:GeometryImage",
    "bff": "baselines.disks.bff:BFF",
    "xatlas": "baselines.tools.xatlas_charts:Xatlas",
    "uvatlas": "baselines.tools.uvatlas:UVAtlas",
    "uvunwrap": "baselines.tools.uvunwrap:UVUnwrap",
    "blender_angle_based": "baselines.tools.blender:BlenderAngleBased",
    "blender_conformal": "baselines.tools.blender:BlenderConformal",
    "blender_minimum_stretch": "baselines.tools.blender:BlenderMinimumStretch",
    "blender_smart_project": "baselines.tools.blender:BlenderSmartProject",
    "meshlab_lscm": "baselines.tools.meshlab:MeshLabLSCM",
    "meshlab_harmonic": "baselines.tools.meshlab:MeshLabHarmonic",
    "meshlab_voronoi": "baselines.tools.meshlab:MeshLabVoronoi",
    "meshlab_triangles": "baselines.tools.meshlab:MeshLabTriangles",
    "unwrap": "parapoint.unwrapping.unwrap:Unwrap",
    "seamster": "baselines.seamster:Seamster",
    "erickson_har_peled": "baselines.erickson_har_peled:EricksonHarPeled",
    "da_wand": "baselines.da_wand:DAWand",
    "automatic+slim": "baselines.hybrid:AutomaticSLIM",
    "artist+slim": "baselines.hybrid:ArtistSLIM",
    "meshed": "baselines.meshed:Meshed",
    "textured": "baselines.textured:Textured",
    "external": "baselines.tools.external:External",
    "parapoint": "parapoint.learned.parapoint:ParaPoint",
    "computed": "parapoint.computed.computed_map:ComputedMap",
    "fam": "baselines.neural.fam:FAM",
    "foldingnet": "baselines.neural.foldingnet:FoldingNet",
    "atlasnet": "baselines.neural.atlasnet:AtlasNet",
    "diffsr": "baselines.neural.diffsr:DiffSR",
    "elestruc": "baselines.neural.elestruc:EleStruc",
    "gtif": "baselines.neural.gtif:GTIF",
    "tearingnet": "baselines.neural.tearingnet:TearingNet",
    "flattening_net": "baselines.neural.flattening_net:FlatteningNet",
    "reggeonet": "baselines.neural.reggeonet:RegGeoNet",
    "nuvo": "baselines.neural.nuvo:Nuvo",
    "nsm": "baselines.neural.nsm:NSM",
}
"""Name -> "module:Class" of each method that comes with the benchmark."""

GROUP = "parapoint.methods"
"""Entry-point group in which an installed package names its methods."""

RENAMED = {"parapoint+slim": "unwrap"}
"""Names in older results, and the name of today."""

_plugins: dict[str, type[Method]] = {}


@dataclass(frozen=True)
class Description:
    """A method in words.

    Attributes:
        summary: first line of its docstring.
        requires: what a surface must be, words of `parapoint.method.REQUIREMENTS`, sorted.
        parameters: its fields and their defaults, as source text; "" for none.
        deterministic: whether it promises the same map for the same seed: "yes", "no", or "by its
            parameters"; ", with as many threads" where it depends on their number.
        environment: what it needs beyond the project's own packages, as pip reads it; a run makes
            an environment that has it.
        licence: of what runs; "" where a plugin does not say (class attribute `licence`).
        citations: what to cite, as entries of BibTeX; a plugin's own is its attribute `citation`.
    """

    summary: str
    requires: tuple[str, ...]
    parameters: dict[str, str]
    deterministic: str
    environment: tuple[str, ...]
    licence: str
    citations: tuple[str, ...]


def names() -> list[str]:
    """Names of all methods: built in, installed, given for this run."""
    return list(dict.fromkeys([*METHODS, *_installed(), *_plugins]))


def method(spec: str) -> tuple[str, Method]:
    """The name and the method of a spec: "slim", or "slim(energy=conformal, iterations=5)".

    Values are Python literals; a bare word is a string.

    Raises:
        InputError: the spec cannot be read; there is no such method or parameter (near names are
            given); a value has the wrong type.
    """
    name, arguments = parsed(spec)
    kind = _class(name)
    hints = get_type_hints(kind)
    known = {field.name: hints[field.name] for field in fields(cast("Any", kind)) if field.init}
    for key, value in arguments.items():
        if key not in known:
            raise InputError(f"{name} has no parameter {key!r}; {_near(key, list(known))}")
        arguments[key] = _checked(value, known[key], f"{name}: {key}")
    with _foreign_code(name):
        return name, kind(**arguments)


def register_plugin(location: str) -> str:
    """The name under which the class at "path/to/file.py:Class" is known for this run.

    The name is the class's in lower case; it may not be taken.

    Raises:
        InputError: the location cannot be read, the file does not run, the class is no method, or
            its name is taken.
    """
    path, _, class_name = location.rpartition(":")
    if not path or not class_name.isidentifier():
        raise InputError(f"a plugin is given as path/to/file.py:Class, not {location!r}")
    file = Path(path).resolve()
    if not file.is_file():
        raise InputError(f"there is no plugin file {path}")
    # The module's name holds the path: two files of one name may be given.
    module_name = f"plugin_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}_{file.stem}"
    if module_name not in sys.modules:
        spec = importlib.util.spec_from_file_location(module_name, file)
        if spec is None or spec.loader is None:
            raise InputError(f"{path} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[module_name] = module  # dataclass and pickle look their module up here
        try:
            with _foreign_code(path):
                spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[module_name]
            raise
    name = class_name.lower()
    kind = _method_class(sys.modules[module_name], class_name, path)
    if name in names() and _plugins.get(name) is not kind:
        raise InputError(f"there is a method {name!r} already; rename the class in {path}")
    _plugins[name] = kind
    return name


@contextlib.contextmanager
def _foreign_code(name: str) -> Iterator[None]:
    """A block that runs code of a plugin, whose errors, and attempts to exit, are bad input.

    Raises:
        InputError: the code raised something other than a KeyboardInterrupt.
    """
    try:
        yield
    except (InputError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise InputError(f"{name} does not run: {type(error).__name__}: {error}") from error


def describe(name: str) -> Description:
    """What there is to say of a method, without making one.

    Raises:
        InputError: there is no such method.
    """
    kind = _class(name)
    parameters = {}
    for field in fields(cast("Any", kind)):
        if field.init:
            factory = field.default_factory
            default = field.default if factory is MISSING else factory()
            parameters[field.name] = "" if default is MISSING else repr(default)
    summary = (kind.__doc__ or "").strip().split("\n", maxsplit=1)[0]
    promise = {True: "yes", False: "no"}.get(getattr(kind, "deterministic", True))
    promise = promise or "by its parameters"
    if promise != "no" and imports(kind, "torch"):
        promise += ", with as many threads"
    requires = tuple(sorted(kind.requires))
    return Description(summary, requires, parameters, promise, environment(kind), *credit(name))


def credit(name: str) -> tuple[str, tuple[str, ...]]:
    """The licence of what a method runs, and what to cite, as entries of BibTeX.

    Methods of the benchmark are not imported for it. A plugin says both as class attributes.

    Raises:
        InputError: there is no such method.
    """
    if name in CREDITS:
        return CREDITS[name].licence, cited(CREDITS[name].keys)
    kind = _class(name)
    citation = str(getattr(kind, "citation", ""))
    return str(getattr(kind, "licence", "")), (citation,) if citation else ()


def environment(made: Method | type[Method]) -> tuple[str, ...]:
    """What a method needs beyond the project's own packages, as pip reads it."""
    return getattr(made, "environment", ())


def source_hash(made: Method) -> str:
    """Hash of what determines a method's results beside its parameters, the same on any machine.

    It covers the source of the method's module, of all that this one imports from this project or
    from its own package, and the versions of the libraries that the class names in `packages`.
    In an environment of its own these may differ from what is installed here: there the run says
    which versions it had, and a later run compares them. Where the surface may be changed before
    the method sees it, the hash covers how.
    """
    modules = [type(made).__module__]
    if made.requires & REPAIRED:
        modules.append("parapoint.surfaces.preparation")
    packages = () if environment(made) else getattr(made, "packages", ())
    return sources.source_hash(*modules, packages=packages)


def depends_on_threads(made: Method) -> bool:
    """Whether the map of a method depends on how many threads it may use.

    So it is with all that torch computes: it parts sums among its threads, and rounding differs
    with the parts.
    """
    return imports(made, "torch")


def imports(made: Method | type[Method], package: str) -> bool:
    """Whether a method names a package in `packages`, or its module has imported it.

    The module may have done so itself or through modules of this project.
    """
    kind = made if isinstance(made, type) else type(made)
    if package in getattr(kind, "packages", ()):
        return True
    module = kind.__module__
    own = {"parapoint", "baselines", module.partition(".")[0]}
    pending, seen = [module], set[str]()
    while pending:
        name = pending.pop()
        if name.partition(".")[0] == package:
            return True
        if name in seen or name.partition(".")[0] not in own or name not in sys.modules:
            continue
        seen.add(name)
        for value in vars(sys.modules[name]).values():
            is_module = isinstance(value, ModuleType)
            other = value.__name__ if is_module else getattr(value, "__module__", None)
            if isinstance(other, str):
                pending.append(other)
    return False


def parsed(spec: str) -> tuple[str, dict[str, Any]]:
    """The name and the arguments in a spec.

    Raises:
        InputError: it is no name, or name(key=value, ...).
    """
    bad = InputError(f"a method is given as name or name(key=value, ...), not {spec!r}")
    found = re.fullmatch(r"\s*([\w.+-]+)\s*(?:\((.*)\))?\s*", spec, flags=re.DOTALL)
    if found is None:
        raise bad
    name, inside = found.groups()
    try:
        call = ast.parse(f"_({inside or ''})", mode="eval").body
    except SyntaxError:
        raise bad from None
    if not isinstance(call, ast.Call) or call.args or any(key.arg is None for key in call.keywords):
        raise bad
    arguments: dict[str, Any] = {}
    for keyword in call.keywords:
        assert keyword.arg is not None
        if keyword.arg in arguments:
            raise InputError(f"{name}: parameter {keyword.arg!r} is given twice")
        if isinstance(keyword.value, ast.Name):
            arguments[keyword.arg] = keyword.value.id
            continue
        try:
            arguments[keyword.arg] = ast.literal_eval(keyword.value)
        except ValueError:
            text = ast.unparse(keyword.value)
            raise InputError(f"{name}: {keyword.arg}={text} is no plain value") from None
    return name, arguments


def _checked(value: object, hint: Any, what: str) -> object:
    """`value` as a parameter of type `hint`: an int will do for a float, a list for a tuple.

    Raises:
        InputError: it has another type, or too many digits.
    """
    if isinstance(value, int) and not -LARGEST_SEED <= value <= LARGEST_SEED:
        raise InputError(f"{what} is a number that 64 bits do not hold")
    if hint is Any:
        return value
    kind, options = get_origin(hint), get_args(hint)
    if kind is Literal:
        if value in options:
            return value
        raise InputError(f"{what} must be one of {', '.join(map(str, options))}, not {value!r}")
    if kind in (Union, types.UnionType):
        for option in options:
            try:
                return _checked(value, option, what)
            except InputError:
                continue
    elif kind is tuple and isinstance(value, (tuple, list)):
        item_hints = [options[0]] * len(value) if options[-1] is Ellipsis else options
        if len(item_hints) == len(value):
            return tuple(_checked(v, h, what) for v, h in zip(value, item_hints, strict=True))
    elif hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    elif (
        isinstance(hint, type)
        and isinstance(value, hint)
        and (hint is bool or not isinstance(value, bool))  # a bool is an int to Python
    ):
        return value
    wanted = hint.__name__ if isinstance(hint, type) else str(hint)
    raise InputError(f"{what} must be {wanted}, not {value!r}")


def _near(name: str, known: list[str]) -> str:
    """The known names nearest to one that is not, in words."""
    if not known:
        return "it has none"
    near = get_close_matches(name, known, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else f"there are: {', '.join(known)}"


@functools.cache
def _installed() -> dict[str, metadata.EntryPoint]:
    """Entry points of installed packages by name; looking reads a file of each package."""
    return {entry.name: entry for entry in metadata.entry_points(group=GROUP)}


def _class(name: str) -> type[Method]:
    """The class of a method.

    Raises:
        InputError: there is none of this name, or it cannot be imported.
    """
    if name in METHODS:
        module_name, _, class_name = METHODS[name].partition(":")
        return _method_class(importlib.import_module(module_name), class_name, module_name)
    if name in _plugins:
        return _plugins[name]
    entry = _installed().get(name)
    if entry is None:
        if name in RENAMED:
            raise InputError(f"there is no method {name!r}: its name is {RENAMED[name]}")
        raise InputError(f"there is no method {name!r}; {_near(name, names())}")
    with _foreign_code(f"the plugin {name} ({entry.value})"):
        module = importlib.import_module(entry.module)
    return _method_class(module, entry.attr, entry.value)


def _method_class(module: ModuleType, class_name: str, where: str) -> type[Method]:
    """The class of this name in a module.

    Raises:
        InputError: there is none, or it is no method.
    """
    kind = getattr(module, class_name, None)
    if not isinstance(kind, type):
        raise InputError(f"there is no class {class_name} in {where}")
    if not is_dataclass(kind) or not callable(getattr(kind, "parameterize", None)):
        raise InputError(f"{class_name} in {where} is no dataclass with a method parameterize")
    requires = getattr(kind, "requires", None)
    if not isinstance(requires, frozenset) or not requires <= REQUIREMENTS.keys():
        raise InputError(
            f"{class_name}.requires in {where} must be a frozenset of "
            f"{', '.join(sorted(REQUIREMENTS))}; it is {requires!r}"
        )
    needed = getattr(kind, "environment", ())
    if not isinstance(needed, tuple) or not all(isinstance(one, str) and one for one in needed):
        raise InputError(
            f"{class_name}.environment in {where} must be a tuple of requirements as pip reads "
            f"them; it is {needed!r}"
        )
    return cast("type[Method]", kind)
