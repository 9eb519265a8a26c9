"""Faults of the performance analysis; see `mutation_list.py`."""

from mutation_list import Mutation

SECTIONS = "tests/test_performance.py -k "
PATHS = "tests/test_performance_paths.py -k "


def fault(name: str, after: str, old: str, new: str, tests: str, compiled: bool = True) -> Mutation:
    """A fault of the room."""
    return Mutation("performance", name, after, old, new, tests, compiled)


MUTATIONS = [
    fault("slope of the determinant without one column",
          "slope = triple(H, 0, J, 1, J, 2)", "+ triple(J, 0, J, 1, H, 2)", "",
          SECTIONS + "curves_are_singular", True),
    fault("sign of a column's derivative", "H[i, k] = T[near, j, 2] * J[m, far]", "- T[near, m",
          "+ T[near, m", SECTIONS + "curves_are_singular", True),
    fault("trace of the Gram matrix counted twice", "if i == j:\n                    trace_of",
          "+= total", "+= 2.0 * total", PATHS + "isotropy_of_two_links", True),
    fault("chords not made up for", "sharp = np.linalg.norm(bend", "bend / 12.0", "bend / 6.0",
          SECTIONS + "annulus"),
    fault("swept volume without the turn", "sweep = 2.0 * pi", "* middle[:, 0]", "* 1.0",
          SECTIONS + "change_of_variables"),
    fault("limits left out of counts", "if limits:\n            valid = valid &",
          "turned_inside(model, arm.model_postures(model, q), True)[1]", "True",
          SECTIONS + "limits_bound_an_area"),
    fault("cusps from the wrong direction", "still = np.column_stack((-forward[:, 1]",
          "forward[:, 0]))", "-forward[:, 0]))", SECTIONS + "triple_root"),
    fault("a line of the limits is missing", "for bound in (low[k], high[k])",
          "(low[k], high[k])", "(low[k],)", SECTIONS + "limits_cut_curves"),
    fault("only the first factor counts", "return np.asarray((self.values(q) > 0.0)",
          "(1 << np.arange(len(self.joints)))", "(1 >> np.arange(len(self.joints)))",
          PATHS + "joint_motion"),
    fault("the torus does not close", "for axis, joined in enumerate(closed):", "if joined",
          "if not joined", SECTIONS + "known_arms"),
    fault("the wrong side of a singular position", "wanted = (values[:, members] > 0.0)",
          "> 0.0", "< 0.0", SECTIONS + "eight_aspects"),
    fault("a bound that is too small", "return Bound(model, rows, chain.columns, length,",
          "np.sqrt(squares)", "0.1 * np.sqrt(squares)", SECTIONS + "bound_holds"),
    fault("a path is proved by its ends alone", "fall = np.abs(b - a)", "@ bound.slopes",
          "@ (0.0 * bound.slopes)", SECTIONS + "bound_of_the_proof"),
    fault("labels without a proof", "return bool((np.abs(products)", "== 1.0", "<= 1.0",
          SECTIONS + "six_joints"),
    fault("a prediction meets any posture", "near = _AGREES * size", "_AGREES * size + 1e-9",
          "100.0 + 0.0 * size", PATHS + "line_breaks or joint_motion"),
    fault("breaks counted from one", "ends[alive] = k", "+ 2", "+ 3", PATHS + "line_breaks"),
    fault("whole turns the wrong way", "least = np.ceil((arm.lower", "- low", "+ low",
          PATHS + "whole_turns"),
    fault("the longest motion is the best", "return int(chosen[price", "argmin", "argmax",
          PATHS + "least_cost"),
    fault("accessible outside the limits",
          "q, inside = turned_inside(arm, q, limits)\n        valid", "&= inside", "&= True",
          SECTIONS + "says_why"),
    fault("collisions do not count", "kept[valid] =", "is_free(q[valid])", "True",
          SECTIONS + "free_workspace or says_why"),
    fault("faces of a zonotope too near", "height += abs(dot)\n                sign[m]",
          "dot > 0.0", "dot < 0.0", PATHS + "extremes_of_the_box"),
    fault("strips of double width", "inside &= abs(height) <=", "1.0 + 1e-9", "2.0",
          PATHS + "torques_balance"),
    fault("mean over all rows", "values[valid] = index_values(arm, q[valid]",
          "valid.sum(axis=1)", "valid.shape[1] + 0 * valid.sum(axis=1)",
          PATHS + "maps_are_those"),
    fault("the border stays in a region", "good &= ~neighbours(", "~inside", "inside",
          SECTIONS + "t_region"),
]  # fmt: skip
