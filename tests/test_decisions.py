"""Nothing is decided by looking into a text written for people: cases are distinguished by enums.

Found by syntax: `verdict.startswith("converged")`, `"bank" in reason`, `title == "Drag"`, `match note:`, the same of
names of estimated parameters, and, in the analysis, `piece.kind == "runs"`. A text is a variable, attribute or key
whose name ends in one of TEXTS; one of KINDS is distinguished by an enum or a class.

Nor is a vector of parameters read by places, `parameters[4:7]`, `effects[-1]`, `fit.values[:3]`: one more parameter
would change its meaning without a word. Parameters have names, which `pack` and `unpack` put in order.
"""

import ast
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from flightpower.analysis.flights.flight_statistics import POOLED
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from tests.our_files import dotted_path, nodes_of, syntax_of

pytestmark = pytest.mark.xdist_group("sources")

ROOT = Path(__file__).parents[1]
PACKAGES = ("analysis", "daq", "flight", "flightpower", "sim")
TEXTS = {
    "verdict", "reason", "note", "title", "text", "message", "warning", "hint", "label", "problem", "sentence", "word",
}  # fmt: skip
TEXTS |= {f"{word}s" for word in TEXTS}
KINDS = {"kind", "cause", "status", "lowers", "level", "outcome", "category"}
PARAMETER = {"name", "parameter"}
SENSOR_ERROR = {"error", "sensor_error"}
VECTORS = {"parameters", "effects", "covariance", "noise", "systematic", "polar", "A", "changes", "change", "theta"}
ESTIMATES = {"fit", "result", "estimate", "joint", "dynamic", "solution", "statistics"}  # of `fit.values`, `fit.x`
LOOKS = {"startswith", "endswith", "removeprefix", "removesuffix", "find", "partition"}
PATTERNS = {"match", "search", "fullmatch", "findall"}
# Modules that read texts which others wrote: files, commands, messages of libraries and of the system.
PARSERS = {
    "analysis/calibrations/": "tables of calibrations, and what the user types",
    "analysis/cli/": "what the user types",
    "analysis/pages/open/form.py": "what the user types",
    "analysis/performance/request.py": "what the user types",
    "analysis/missions/mission.py": "what the user types",
    "analysis/missions/qgroundcontrol.py": "missions of ground stations",
    "analysis/missions/lines.py": "missions of ground stations",
    "analysis/sources/": "messages, parameters and columns of logs that others wrote",
    "daq/config.py": "messages of msgspec",
    "daq/linux_bus.py": "names of the kernel's files",
    "daq/part_identity.py": "answers of parts",
    "daq/sensors/": "answers of parts",
    "daq/thrust.py": "files of propellers",
    "flight/command_line.py": "what the user types",
    "flight/propeller_files.py": "files of propellers",
    "flight/propeller_search.py": "what the user types, and files of propellers",
    "flight/undecodable.py": "messages of msgspec",
    "flight/unit_columns.py": "columns of tables of calibrations",
    "flight/units.py": "quantities that the user types",
    "sim/ulog_writer.py": "types of the fields of ULog",
}


class Finding(NamedTuple):
    path: str
    line: int
    code: str


def decisions_by_text(root: Path) -> list[Finding]:
    """Where a text for people decides something, in all packages under a folder."""
    paths = [path for package in PACKAGES for path in sorted((root / package).rglob("*.py"))]
    modules = {path.relative_to(root).as_posix(): path for path in paths}
    constants = {name: _text_constants(syntax_of(path)) for name, path in modules.items()}
    decisions = []
    for name, path in modules.items():
        if not name.startswith(tuple(PARSERS)):
            constants_here = constants[name] | _imported_constants(syntax_of(path), constants)
            nodes = [node for node in nodes_of(path) if isinstance(node, ast.expr | ast.Match)]
            deciding = [
                node
                for node in nodes
                if _decides(node, constants_here) or (name.startswith("analysis/") and _tells_kinds(node))
            ]
            decisions += [Finding(name, node.lineno, ast.unparse(node)) for node in deciding]
    return decisions


def _decides(node: ast.AST, constants: set[str]) -> bool:
    match node:
        case ast.Call(func=ast.Attribute(value=text, attr=method), args=[sought, *_]) if method in LOOKS:
            return _literals(sought, constants) and (_is_text(text) or (_is_parameter(text) and _is_name(sought)))
        case ast.Call(func=ast.Attribute(value=ast.Name(id="re"), attr=method), args=[_, text, *_]):
            return method in PATTERNS and _is_text(text)
        case ast.Compare(left=left, ops=[operator], comparators=[right]):
            return _compares(left, operator, right, constants)
        case ast.Match(subject=subject, cases=cases):
            return _is_text(subject) and any(_is_literal(case.pattern) for case in cases)
    return False


def _compares(left: ast.expr, operator: ast.cmpop, right: ast.expr, constants: set[str]) -> bool:
    if isinstance(operator, ast.In | ast.NotIn):
        within = _literals(left, constants) and (_is_text(right) or (_is_parameter(right) and _is_name(left)))
        one_of = (_is_text(left) and _literals(right, constants)) or (_is_estimate(left) and _estimated(right))
        return within or one_of
    if isinstance(operator, ast.Eq | ast.NotEq):
        return any(
            (_is_text(expr) and _literals(other, constants)) or (_is_estimate(expr) and _estimated(other))
            for expr, other in ((left, right), (right, left))
        )
    return False


def _tells_kinds(node: ast.AST) -> bool:
    match node:
        case ast.Compare(left=left, ops=[ast.Eq() | ast.NotEq() | ast.In() | ast.NotIn()], comparators=[right]):
            return any(_is_kind(item) and bool(_strings(other)) for item, other in ((left, right), (right, left)))
        case ast.Match(subject=subject, cases=cases):
            return _is_kind(subject) and any(_is_literal(case.pattern) for case in cases)
    return False


def _is_kind(node: ast.expr) -> bool:
    return _last_name(node).lower().split("_")[-1] in KINDS


def _is_literal(pattern: ast.pattern) -> bool:
    return isinstance(pattern, ast.MatchValue) and isinstance(pattern.value, ast.Constant)


def _last_name(node: ast.expr) -> str:
    """The last name in an expression: `reason` in `verdict.reason`, `reason`, `verdict["reason"]`, `str(reason)`,
    `reason.lower()`."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case ast.Subscript(slice=ast.Constant(value=str(name))):
            return name
        case ast.Subscript(value=value):
            return _last_name(value)
        case (
            ast.Call(func=ast.Name(id="str"), args=[inner])
            | ast.Call(func=ast.Attribute(value=inner, attr="lower" | "strip"))
        ):
            return _last_name(inner)
    return ""


def _is_text(node: ast.expr) -> bool:
    return _last_name(node).lower().split("_")[-1] in TEXTS


def _is_parameter(node: ast.expr) -> bool:
    return _last_name(node) in PARAMETER


def _is_estimate(node: ast.expr) -> bool:
    return _is_parameter(node) or _last_name(node) in SENSOR_ERROR


def _is_name(node: ast.expr) -> bool:
    """Whether a text is a name, and not a file's suffix, an option's dashes, Python's underscores or an address's
    colon."""
    return all(text[0] not in ".-_" and text[-1] != ":" for text in _strings(node))


def _strings(node: ast.expr) -> list[str]:
    elements = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]
    return [
        element.value
        for element in elements
        if isinstance(element, ast.Constant) and isinstance(element.value, str) and element.value
    ]


def _literals(node: ast.expr, constants: set[str]) -> bool:
    elements = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]
    named = any(isinstance(element, ast.Name) and element.id in constants for element in elements)
    return bool(_strings(node)) or named or any(isinstance(element, ast.JoinedStr) for element in elements)


def _estimated(node: ast.expr) -> bool:
    return not estimated().isdisjoint(_strings(node))


@cache
def estimated() -> frozenset[str]:
    """Names of estimated quantities: sensor errors, pooled quantities, and every `Parameter(name="…")`."""
    paths = [path for name in ("methods", "performance") for path in (ROOT / "analysis" / name).rglob("*.py")]
    calls = [item for path in paths for item in nodes_of(path) if isinstance(item, ast.Call)]
    parameters = [call for call in calls if _last_name(call.func) in ("Parameter", "ParameterVector")]
    named = [[*call.args[:1], *(key.value for key in call.keywords if key.arg == "name")] for call in parameters]
    return frozenset(
        {*SENSOR_ERRORS, *POOLED, *(name for arguments in named for item in arguments for name in _strings(item))}
    )


def _text_constants(tree: ast.Module) -> set[str]:
    """Names that a module gives to texts."""
    return {
        target.id
        for node in tree.body
        if isinstance(node, ast.Assign) and _strings(node.value)
        for target in node.targets
        if isinstance(target, ast.Name)
    }


def _imported_constants(tree: ast.Module, constants: dict[str, set[str]]) -> set[str]:
    return {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
        if alias.name in constants.get(f"{dotted_path(node.module).replace('.', '/')}.py", set())
    }


@pytest.mark.slow
def test_nothing_is_decided_by_a_text() -> None:
    assert [f"{decision.path}:{decision.line}: {decision.code}" for decision in decisions_by_text(ROOT)] == []


def test_every_parser_exists() -> None:
    assert [path for path in PARSERS if not (ROOT / path).exists()] == []


@pytest.mark.parametrize(
    "code",
    [
        'ok = results.verdict.startswith(("converged", "by "))',
        'ok = "bank" in str(reason)',
        'ok = run["title"] == "Drag"',
        'ok = reason == BELOW\nBELOW = "below"',
        'ok = re.search("bank", note)',
        'ok = name.startswith("ln w(")',
        'ok = parameter == "thrust_scale"',
        'ok = shift.error == "air_data_lag"',
        'ok = piece.kind in ("circuit", "circles")',
        'ok = found.cause != "noise"',
        'match verdict:\n    case "converged":\n        pass',
    ],
)
def test_a_decision_by_text_is_found(code: str, tmp_path: Path) -> None:
    (tmp_path / "analysis").mkdir()
    (tmp_path / "analysis" / "page.py").write_text(code, "utf-8")
    assert len(decisions_by_text(tmp_path)) == 1


@pytest.mark.parametrize(
    "code",
    [
        "ok = verdict.status is FitStatus.CONVERGED",
        "ok = reason == Reason.BANK",
        "match reason:\n    case Reason.BANK:\n        pass",
        'ok = path.name.endswith(".toml")',
        'ok = "V_scale" in names',
        "ok = piece.kind is PieceKind.RUNS",
        'text = note or "none"',
    ],
)
def test_an_enum_and_the_name_of_a_file_are_no_text(code: str, tmp_path: Path) -> None:
    (tmp_path / "analysis").mkdir()
    (tmp_path / "analysis" / "page.py").write_text(code, "utf-8")
    assert decisions_by_text(tmp_path) == []


def read_by_place(root: Path) -> list[Finding]:
    """Finds code of the analysis that indexes a parameter vector, or its covariance, by literal numbers."""
    findings = []
    for path in sorted((root / "analysis").rglob("*.py")):
        findings += [
            Finding(path.relative_to(root).as_posix(), node.lineno, ast.unparse(node))
            for node in nodes_of(path)
            if isinstance(node, ast.Subscript) and _is_vector(node.value) and _has_place(node.slice)
        ]
    return findings


def _is_vector(node: ast.expr) -> bool:
    match node:
        case ast.Attribute(value=of, attr="values" | "value" | "x"):
            return _last_name(of) in ESTIMATES | {"parameters", "polar"}
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name.split("_")[-1] in VECTORS
    return False


def _has_place(node: ast.expr) -> bool:
    match node:
        case ast.Tuple(elts=elements):
            return any(map(_has_place, elements))
        case ast.Slice(lower=lower, upper=upper):
            return any(_has_place(end) for end in (lower, upper) if end)
        case ast.UnaryOp(operand=operand):
            return _has_place(operand)
    return isinstance(node, ast.Constant) and type(node.value) is int


def test_no_vector_of_parameters_is_read_by_places() -> None:
    assert [f"{finding.path}:{finding.line}: {finding.code}" for finding in read_by_place(ROOT)] == []


@pytest.mark.parametrize(
    ("code", "times"),
    [
        ("ln_beta, *_ = parameters[-4:]", 1),
        ("own = effects[:2].T @ effects[-5:-1]", 2),
        ("polar = fit.values[:3], total.parameter_covariance[:3, 3:]", 2),
        ("wind = found.parameters.value[0]", 1),
        ("A0, A1, A2 = polar.A", 0),
        ("k = covariance[at, at], covariance[: len(POLAR)], names[0], parameters['k'], row.values[0]", 0),
    ],
)
def test_reading_by_places_is_found(code: str, times: int, tmp_path: Path) -> None:
    (tmp_path / "analysis").mkdir()
    (tmp_path / "analysis" / "page.py").write_text(code, "utf-8")
    assert len(read_by_place(tmp_path)) == times
