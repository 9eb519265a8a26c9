"""Torques of drives that each turn their own joint: rotor inertia, friction, offset."""

from ._compile import MATRIX, NOTHING, OUT2, VECTOR, Floats, compiled

__all__ = ["drive_torques"]


@compiled(NOTHING(MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, OUT2))
def drive_torques(
    v: Floats, a: Floats, Ia: Floats, Fv: Floats, Fc: Floats, offset: Floats, out: Floats
) -> None:
    """``Ia a + Fv v + Fc sign(v) + offset``, joint by joint.

    Shapes: v, a (N, n); Ia, Fv, Fc, offset (n,) -> out (N, n).
    """
    for i in range(v.shape[0]):
        for j in range(v.shape[1]):
            dry = Fc[j] if v[i, j] > 0.0 else (-Fc[j] if v[i, j] < 0.0 else 0.0)
            out[i, j] = Ia[j] * a[i, j] + Fv[j] * v[i, j] + offset[j] + dry
