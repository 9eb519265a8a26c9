"""Planted faults of visual servoing: interaction matrices, laws, statuses, poses, the robot."""

from mutation_list import Mutation

LOOK = "tests/test_visual_servoing.py -k "
ACT = "tests/test_visual_servoing_control.py -k "
DERIVATIVE = LOOK + "derivative"
LINKS = LOOK + "virtual_links"
ROOM = "visual_servoing"

_FAULTS = [
    ("sign of the depth column", "def point_rows", "x * w, y * w", "x * w, -y * w", DERIVATIVE),
    ("turn of a line", "turn, shift = ", "b * cos - a * sin", "b * cos + a * sin", DERIVATIVE),
    ("sign of theta about the axis", "second = turn * cos", "still - 1.0", "still + 1.0",
     DERIVATIVE),
    ("end of a segment", "last = point_rows", "far", "near", DERIVATIVE),
    ("third moments of an ellipse", "m[..., 2, 1] =", "2.0 * x * n11", "x * n11", DERIVATIVE),
    ("order of a moment", "order = i + j", "+ 3", "+ 2", DERIVATIVE),
    ("dropped area of a moment", "order * (a * right", " - c * here", "", DERIVATIVE),
    ("half in L of theta u", "L[..., 3:] = np.eye(3) +", "0.5 * S", "-0.5 * S", DERIVATIVE),
    ("a point in space", "L[..., 3:] = skew(X)", "skew(X)", "-skew(X)", DERIVATIVE),
    ("plane of a sphere", "polar = np.concatenate", "-excess", "excess", DERIVATIVE),
    ("contact of a cylinder", "contact = nearest", "- self.radius", "+ self.radius",
     DERIVATIVE),
    ("log of the depth", "L[..., 2, 2], L[..., 2, 3]", "-w, -y, x", "-w, y, x", DERIVATIVE),
    ("mu of third order", "mu21 = m[2, 1]", "* 2.0 - y", "- y", LOOK + "moments or skewness"),
    ("semi-axes of an ellipse", "scale = -(Q[", "4.0 *", "2.0 *", LOOK + "projections"),
    ("rows of a kernel", "kernel = Vt[rank", "[rank:]", "[:rank]", LINKS),
    ("Broyden's denominator", "B = A + part", "unit / (unit @ unit)", "unit", LOOK + "learnt"),
    ("rotation from the current camera", "R = self.desired[:3, :3] @",
     "np.swapaxes(T[..., :3, :3], -1, -2)", "T[..., :3, :3]", ACT + "half_dimensional"),
    ("mean of pseudo-inverses", "inverse = 0.5 *", "own + ", "own - ", ACT + "matrices_of_the_law"),
    ("depth of the desired pose", "w, image = self._w", "self._w", "None",
     ACT + "matrices_of_the_law"),
    ("sign of the law", "v = -primary.gain", "-primary.gain", "primary.gain", ACT + "decay"),
    ("minimum not told", "<= _REDUCIBLE * size", "<= _REDUCIBLE", "<= 0.0", ACT + "local_minimum"),
    ("singular matrix not told", "pseudo_inverse(feature.interaction(nearby))[1]", "> rank",
     "< rank", ACT + "cylinder"),
    ("image not looked at", "and not feature._in_image", "not feature", "feature", ACT + "sight"),
    ("period of an angle", "whole * np.round", "whole *", "2.0 * whole *", ACT + "short_way"),
    ("projection of a hybrid task", "task.weight * (z - own", "z - own", "z + own",
     ACT + "along_a_line"),
    ("lever of the camera on the tool", "np.concatenate((linear + np.cross", "+ np.cross",
     "- np.cross", ACT + "robot_follows"),
    ("eye to hand has the other sign", "as the camera would in the other sense", "v = -seen",
     "v = seen", ACT + "robot_follows"),
    ("limits not kept", "self.limits = None if limits", "False", "not None", ACT + "limits"),
    ("limited robot not told", "met |= bool(found.status", "== IKMStatus", "!= IKMStatus",
     ACT + "limits"),
    ("order of Runge-Kutta", "whole = q1 + q2 + q3", "/ 3.0", "/ 6.0", ACT + "exponentially"),
    ("Kalman gain", "K = P[:, 0]", "2.0 *", "1.0 *", ACT + "kalman"),
    ("own motion of the camera", "seen = (s - last.s)", " - own", "", ACT + "tracked"),
    ("law of cosines", "E[:, row, i, j] = E[:, row, j, i]", "-(rays", "(rays",
     ACT + "three_points"),
    ("resultant of the cones", "quartic = (_mul(ac, ac)", "- _mul(ab, bc)", "+ _mul(ab, bc)",
     ACT + "three_points"),
    ("other minimum of a plane", "R = Rotation.from_rotvec(2.0", "* half", "* 0.0 * half",
     ACT + "far_away"),
    ("damping of virtual servoing", "step: Array = -np", "-np", "np", ACT + "many_points"),
    ("sign of a homography", "return H if depth", "depth > 0.0", "depth < 0.0",
     ACT + "homographies"),
    ("second motion of a homography", "found += [(R, t, n)", "-t, -n", "t, -n",
     ACT + "homographies"),
]  # fmt: skip
MUTATIONS = [Mutation(ROOM, *fault) for fault in _FAULTS]
