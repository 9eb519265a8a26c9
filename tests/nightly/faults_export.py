"""Faults of `robotmodels.export`: the tape, the recursions, the plan unrolled, the printers."""

from mutation_list import Mutation

TESTS = "tests/test_export.py"
MODELS = f"{TESTS} -k (tape_is_the_library or mimic)"
POSTURES = f"{TESTS} -k (all_postures or singular_poses)"
LANGUAGE = f"{TESTS} -k (test_c or python_and_numpy or matlab)"
COUNTS = f"{TESTS} -k (operations or exact or tape_shares)"
NAMES = f"{TESTS} -k (names or symbols or value or refused)"


MOTIONS = "Motions of all links; the base"


def fault(text: str, after: str, old: str, new: str, tests: str = MODELS) -> Mutation:
    """A fault of this room."""
    return Mutation("export", text, after, old, new, tests)


MUTATIONS = [
    fault("difference of an ordered pair reversed", "def __add__(self, other: Number) -> Number:",
          "first > 0 else -1", "first < 0 else -1"),
    fault("sign of a product", "def __mul__(self, other: Number) -> Number:",
          "(a < 0) == (b < 0)", "(a < 0) != (b < 0)"),
    fault("products are not shared", "def __mul__(self, other: Number) -> Number:",
          "tuple(sorted((abs(a), abs(b))))", "(abs(a), abs(b))", COUNTS),
    fault("equal operations are not shared", "def add(self, operation: str,",
          "if node not in self._numbers:", "if True:", COUNTS),
    fault("lines that nothing needs are kept", "def frozen(self, results", "[False]", "[True]",
          COUNTS),
    fault("a cosine is odd", "def function(name: str,", 'and name != "cos"', "", COUNTS),
    fault("choice the wrong way round", '"pick": lambda', "a > b", "a < b", POSTURES),
    fault("sine of 45 degrees", "_SINES = {", "sqrt(0.5)", "0.5", COUNTS),
    fault("quarter turns of an offset", "def cosine_sine(angle", "(s, -c))", "(-s, c))"),
    fault("inward is outward", "def inward(self, a: Vector)", "c, -s", "c, s"),
    fault("shift of d before alpha", "d lies along the axis x", "*before[1]", "*before[0]"),
    fault("offset of a prismatic joint", "def links_of(model", "q[j] + r if", "q[j] if"),
    fault("gravity is not replaced by an acceleration", MOTIONS, "-model.gravity",
          "model.gravity"),
    fault("Coriolis acceleration of a prismatic joint", MOTIONS, "2.0 * rate", "rate"),
    fault("velocity product of a revolute joint", MOTIONS, "dw[1] - w[0] * rate",
          "dw[1] + w[0] * rate"),
    fault("gyroscopic moment", "Force ``M u + U MS`` and moment", "(ZZ - YY)", "(ZZ + YY)"),
    fault("first moments times acceleration", "Force ``M u + U MS`` and moment", "cross(MS, u)",
          "cross(u, MS)"),
    fault("moment of a force along r", "def passed_on(", "- link.r * F[1]", "+ link.r * F[1]"),
    fault("lever of the tool", "def tool_wrench(", "cross(point, F)", "cross(F, point)"),
    fault("coupled motors count their own joint", "Torques of rotors, friction and offsets",
          "rate - w[j] * v[j]",
          "rate"),
    fault("shift of an inertia matrix", "def _shifted(", "0.5 * mass", "mass"),
    fault("turned products of inertia", "def _moved_body(", "c * J[ik] - s * J[jk]",
          "c * J[ik] + s * J[jk]"),
    fault("elimination leaves the right side", "Solution of ``M x = right`` by",
          "x[i] - factor * x[k]", "x[i]"),
    fault("offsets are lost with base parameters", "def dynamic_parameters(",
          "if k not in base.parameter_names", "if k in base.parameter_names"),
    fault("one symbol for different numbers", "def geometric_parameters(", "len(same) == 1",
          "len(same) > 0", NAMES),
    fault("keywords are not mended", "def _mended(", "name in _WORDS", 'name == ""', NAMES),
    fault("second branch of the shoulder is the first", "def opposite_angles(", "[-g[0], -g[1]]",
          "g", POSTURES),
    fault("sign of the root", "double = pick(room, _NEAR", "Y * Z - X * e", "Y * Z + X * e",
          POSTURES),
    fault("false candidates are kept", "def _keep(", "_below(_larger(far,",
          "_size(_larger(far,", f"{TESTS} -k all_postures"),
    fault("resolvent of the quartic", "Ferrari's formulas for", "0.25 * p * p - r",
          "0.25 * p * p + r",
          f"{TESTS} -k (all_postures and skew)"),
    fault("coefficients of the half angle", "Ferrari's formulas for", "2.0 * a2 + 4.0 * a4",
          "2.0 * a2 - 4.0 * a4",
          f"{TESTS} -k (all_postures and skew)"),
    fault("a free joint has no status", "Regular, doubtful or free", "_DOUBTFUL, _FREE",
          "_DOUBTFUL, 0.0",
          POSTURES),
    fault("angles are not brought into one turn", "def _keep(", "2.0 * pi", "0.0",
          POSTURES),
    fault("brackets of a difference", "def lines_of(program", "operand(b, level + 1)",
          "operand(b, level)", LANGUAGE),
    fault("columns of a matrix in MATLAB and C", "def element(self, port", "port.shape[-1]", "3",
          LANGUAGE),
]  # fmt: skip
