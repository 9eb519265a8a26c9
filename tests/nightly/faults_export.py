"""Faults of `robotmodels.export`: the tape, the recursions, the plan unrolled, the printers."""

from mutation_list import Mutation

TESTS = "tests/test_export.py"
MODELS = f"{TESTS} -k (tape_is_the_library or mimic)"
POSTURES = f"{TESTS} -k (all_postures or singular_poses)"
LANGUAGE = f"{TESTS} -k (languages or matlab)"
COUNTS = f"{TESTS} -k (operations or tape_shares)"
TYPES = f"{TESTS} -k types_of_equations"
NAMES = f"{TESTS} -k (names or symbols or refused)"


MOTIONS = "acceleration of the origin, Khalil's ``U``"
FORCES = "Joint torques of a motion, drives and the wrench"


def fault(text: str, after: str, old: str, new: str, tests: str = MODELS) -> Mutation:
    """A fault of this room."""
    return Mutation("export", text, after, old, new, tests)


MUTATIONS = [
    fault("difference of an ordered pair reversed", "def __add__(self, other: Number) -> Number:",
          "is_negative=low < 0", "is_negative=high < 0"),
    fault("sign of a product", "def __mul__(self, other: Number) -> Number:",
          "(a < 0) != (b < 0)", "(a < 0) == (b < 0)"),
    fault("products are not shared", "def __mul__(self, other: Number) -> Number:",
          "sorted((self.number, self.tape.number(other)), key=abs)",
          "(self.number, self.tape.number(other))", COUNTS),
    fault("equal operations are not shared", "def add(self, operation: str,",
          "if node not in self._numbers:", "if True:", COUNTS),
    fault("lines that nothing needs are kept", "def frozen(self, results",
          "abs(k) for row in wanted for k in row",
          "k + 1 for k in range(len(self.nodes))", COUNTS),
    fault("a cosine is odd", "def function(name: str,", 'and name != "cos"', "", COUNTS),
    fault("choice the wrong way round", '"pick": lambda', "a > b", "a < b", POSTURES),
    fault("sine of 45 degrees", "_SINES = (", "sqrt(0.5)", "0.6", COUNTS),
    fault("quarter turns of an offset", "def _cosine_sine(angle", "(s, -c))", "(-s, c))"),
    fault("inward is outward", "def inward(self, a: Vector)", "c, -s", "c, s"),
    fault("shift of d before alpha", "d lies along the axis x", "*before[1]", "*before[0]"),
    fault("offset of a prismatic joint", "def links_of(", "q[j] + r if", "q[j] if"),
    fault("gravity is not replaced by an acceleration", MOTIONS, "-model.gravity",
          "model.gravity"),
    fault("Coriolis acceleration of a prismatic joint", MOTIONS, "2.0 * rate", "rate"),
    fault("velocity product of a revolute joint", MOTIONS, "-w[0] * rate, change), w",
          "w[0] * rate, change), w"),
    fault("gyroscopic moment", FORCES, "(ZZ - YY)", "(ZZ + YY)"),
    fault("first moments times acceleration", FORCES, "cross(MS, u)", "cross(u, MS)"),
    fault("moment of a force along r", "def passed_on(", "-(link.r * F[1])", "(link.r * F[1])"),
    fault("lever of the tool", "def tool_wrench(", "cross(point, FN[0])", "cross(FN[0], point)"),
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
    fault("keywords are not mended", "the elements of parameters, given with", "new in _WORDS",
          'new == ""', NAMES),
    fault("second branch of the shoulder is the first", "def opposite_angles(", "(1.0, -1.0)",
          "(1.0, 1.0)", POSTURES),
    fault("sign of the root", "double = pick(room, _NEAR", "Y * Z - X * e", "Y * Z + X * e",
          POSTURES),
    fault("false candidates are kept", "joint variables in (-pi, pi].", "_below(_larger(off",
          "_size(_larger(off", f"{TESTS} -k all_postures"),
    fault("resolvent of the quartic", "Ferrari's formulas for", "0.25 * p * p - r",
          "0.25 * p * p + r",
          f"{TESTS} -k (all_postures and skew)"),
    fault("coefficients of the half angle", "Ferrari's formulas for", "2.0 * a2 + 4.0 * a4",
          "2.0 * a2 - 4.0 * a4",
          f"{TESTS} -k (all_postures and skew)"),
    fault("a free joint has no status", "Regular, doubtful or free", "_DOUBTFUL, _FREE",
          "_DOUBTFUL, 0.0",
          POSTURES),
    fault("angles are not brought into one turn", "joint variables in (-pi, pi].", "2.0 * pi",
          "0.0",
          POSTURES),
    fault("brackets of a difference", "def _lines(program", "operand(b, level + 1)",
          "operand(b, level)", LANGUAGE),
    fault("columns of a matrix in MATLAB and C", "def element(self, port", "port.shape[-1]", "3",
          LANGUAGE),
    fault("length with an angle", "An equation without r gives the angle", "A[1] - Y2",
          "A[1] + Y2", TYPES),
    fault("length times an angle", "An equation without r gives the angle", "X2 * Y1, X1 * Y2",
          "X2 * Y2, X1 * Y1",
          TYPES),
    fault("polynomial of a length", "def polynomial(g", "g0 - g2 + g4", "g0 + g2 + g4", TYPES),
    fault("fewer parameters with other torques", "def dynamic_parameters(", "fewer if is_same",
          "fewer if not is_same", COUNTS),
    fault("rows of a result", 'class Language(NamedTuple)', "(*port.shape, 1, 1)",
          "(*port.shape[::-1], 1, 1)", LANGUAGE),
]  # fmt: skip
