"""Faults of control laws and of feedback in simulations, and the tests that must see them."""

from mutation_list import Mutation

TESTS = "tests/test_control.py"
FREE = f"{TESTS} -k (computed or masks or dry_friction)"
JOINTS = f"{TESTS} -k (pid or pd or lyapunov or feedforward)"
SLIDING = f"{TESTS} -k (sliding or twisting)"
ADAPTIVE = f"{TESTS} -k (adaptive or slotine or standard)"
CONTACT = f"{TESTS} -k (walls or contact or impedance or admittance or mass_on)"
FORCE = f"{TESTS} -k (hybrid or historical or external or consistent)"
RUNS = f"{TESTS} -k (runs or sampling or statuses)"
FEEDBACK = "tests/test_simulation.py -k (state_of or sampled or feedback)"

MUTATIONS = [
    Mutation("control: kernels", "the drift of the error of a rotation loses a product",
        "w_e = subtract((twist[3]", "cross(w_e, w_r)", "scale(0.0, cross(w_e, w_r))", FREE, True),
    Mutation("control: kernels", "forces disturb positions", "def solve(\n    J: Floats, wanted",
        "B[p, i] -= along * used[s, i]", "B[p, i] -= 0.0 * used[s, i]", FORCE, True),
    Mutation("control: kernels", "near singular postures are not damped",
        "def solve(\n    J: Floats, wanted",
        "max(lengths[r], least * longest)", "lengths[r]", f"{TESTS} -k singular", True),
    Mutation("control: kernels", "a moment is not brought to the coordinates of the error",
        "w_e = subtract((twist[3]", "(wrench[3], wrench[4], wrench[5]), a, b)",
        "(wrench[3], wrench[4], wrench[5]), 0.0, 0.0)", CONTACT, True),
    Mutation("control: computed torque", "half of the damping", "class ComputedTorque(",
        "self._obey(2.0 * self.zeta", "self._obey(self.zeta", FREE),
    Mutation("control: computed torque", "the drift of the tool is added",
        "damping, stiffness, softness = self._linear",
        "(e + by) + drift", "(e + by) - drift", FREE),
    Mutation("control: model", "a joint at rest has no friction of the way it is moved",
        "def started(", "_SLOWEST * np.sign(towards)", "0.0 * np.sign(towards)", FREE),
    Mutation("control: model", "squares of the virtual torques are added", "def virtual_torques(",
        "drive=False) - less", "drive=False) + less", JOINTS),
    Mutation("control: PID gains", "the margin forgets the friction", "def critical_ki(",
        "(self.kd + self.viscous)", "(self.kd - self.viscous)", JOINTS),
    Mutation("control: passivity", "the gain acts against s", "class Passivity(",
        "+ self.gain * (v_r - v)", "- self.gain * (v_r - v)", JOINTS),
    Mutation("control: sliding", "the layer is twice as wide", "class SlidingMode(",
        "np.clip(s / self.layer", "np.clip(0.5 * s / self.layer", SLIDING),
    Mutation("control: sliding", "super-twisting without its root", "class SuperTwisting(",
        "np.sqrt(np.abs(s)) * way", "np.abs(s) * way", SLIDING),
    Mutation("control: adaptive", "the regressor of a difference of squares has its sign wrong",
        "def _regressors(", "W -= squares", "W += squares", ADAPTIVE),
    Mutation("control: adaptive", "estimates move away", "class AdaptiveSlotineLi(",
        "self.adaptation * (s @ Y)", "-self.adaptation * (s @ Y)", ADAPTIVE),
    Mutation("control: adaptive", "every parameter counts as excited",
        "A sentence that names the parameters",
        "if part > _REMAINS", "if part > 2.0", ADAPTIVE),
    Mutation("control: impedance", "the measured wrench pushes the wrong way",
        "damping, stiffness, softness = self._linear",
        "+ drift - softness * force", "+ drift + softness * force", CONTACT),
    Mutation("control: admittance", "the compliance forgets its stiffness", "class Admittance(",
        "+ self.K * xi) / self.M", "+ 0.0 * xi) / self.M", CONTACT),
    Mutation("control: admittance", "the position follows the rate too late", "class Admittance(",
        "(damping - self.B / self.M)", "(0.0 - self.B / self.M)", CONTACT),
    Mutation("control: walls", "a wall pulls", "def __call__(self, t: float, T: ArrayLike",
        "np.maximum(push, 0.0)", "push", CONTACT),
    Mutation("control: walls", "friction drives the tool",
        "def __call__(self, t: float, T: ArrayLike",
        "drag[..., None] * sliding", "-drag[..., None] * sliding", CONTACT),
    Mutation("control: force", "the measured rate has the wrong sign", "def pushes(",
        "np.zeros((4, 6)), -kv", "np.zeros((4, 6)), kv", CONTACT),
    Mutation("control: hybrid", "the wrench is added twice", "class ParallelHybrid(",
        "q, v, a) + load", "q, v, a) + 2.0 * load", FORCE),
    Mutation("control: hybrid", "the axes of the task are transposed", "class _Split(",
        "[:3, :3].T)", "[:3, :3])", FORCE),
    Mutation("control: external loop", "the integral alone", "class ExternalForceLoop(",
        "x + speed / self.gain", "x", FORCE),
    Mutation("control: run", "upper limits are not looked at", "peaks := _growing(",
        "motion.q > model.upper", "motion.q > np.inf", RUNS),
    Mutation("control: run", "growth counts as following", "peaks := _growing(",
        "return ControlStatus.DIVERGED, (", "return ControlStatus.FOLLOWED, (", JOINTS),
    Mutation("simulation: feedback", "a sampled state is a step ahead", "def tick(self, t",
        "x = self._state = self._next", "x, self._state = self._state, self._next", FEEDBACK),
    Mutation("simulation: feedback", "a delay rounds up to whole periods", "class Sampled(Feed",
        "rest if rest >= tolerance", "period if rest >= tolerance", FEEDBACK),
]  # fmt: skip
