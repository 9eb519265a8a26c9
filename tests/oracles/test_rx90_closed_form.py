"""The direct geometric model of the Staubli RX-90 as the seed book writes it out, Example 1.2."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotmodels as rm

angles = st.floats(-2 * np.pi, 2 * np.pi)


def rx90(D3, RL4):
    """Table 1.1."""
    right = np.pi / 2
    return rm.RobotModel.from_table(
        rm.DHTable(
            antecedent=range(6),
            sigma=[0] * 6,
            alpha=[0, right, 0, -right, right, -right],
            d=[0, 0, D3, 0, 0, 0],
            r=[0, 0, 0, RL4, 0, 0],
        )
    )


def closed_form(q, D3, RL4):
    """The book's twelve components, letter by letter."""
    C1, C2, _, C4, C5, C6 = np.cos(q)
    S1, S2, _, S4, S5, S6 = np.sin(q)
    C23, S23 = np.cos(q[1] + q[2]), np.sin(q[1] + q[2])
    s = (
        C1 * (C23 * (C4 * C5 * C6 - S4 * S6) - S23 * S5 * C6) - S1 * (S4 * C5 * C6 + C4 * S6),
        S1 * (C23 * (C4 * C5 * C6 - S4 * S6) - S23 * S5 * C6) + C1 * (S4 * C5 * C6 + C4 * S6),
        S23 * (C4 * C5 * C6 - S4 * S6) + C23 * S5 * C6,
    )
    n = (
        C1 * (-C23 * (C4 * C5 * S6 + S4 * C6) + S23 * S5 * S6) + S1 * (S4 * C5 * S6 - C4 * C6),
        S1 * (-C23 * (C4 * C5 * S6 + S4 * C6) + S23 * S5 * S6) - C1 * (S4 * C5 * S6 - C4 * C6),
        -S23 * (C4 * C5 * S6 + S4 * C6) - C23 * S5 * S6,
    )
    a = (
        -C1 * (C23 * C4 * S5 + S23 * C5) + S1 * S4 * S5,
        -S1 * (C23 * C4 * S5 + S23 * C5) - C1 * S4 * S5,
        -S23 * C4 * S5 + C23 * C5,
    )
    P = (
        -C1 * (S23 * RL4 - C2 * D3),
        -S1 * (S23 * RL4 - C2 * D3),
        C23 * RL4 + S2 * D3,
    )
    return np.array([s, n, a, P]).T


@pytest.mark.parametrize(("D3", "RL4"), [(0.45, 0.45), (0.3, 0.7), (0.0, 1.0), (12.5, -0.2)])
@given(q=st.tuples(*[angles] * 6))
def test_every_component(q, D3, RL4):
    model, q = rx90(D3, RL4), np.array(q)
    expected = closed_form(q, D3, RL4)
    size = max(1.0, abs(D3), abs(RL4))
    for pose in (rm.dgm(model, q), rm.dgm(model, [q])[0]):
        np.testing.assert_allclose(pose[:3, :3], expected[:, :3], rtol=0, atol=2e-15)
        np.testing.assert_allclose(pose[:3, 3], expected[:, 3], rtol=0, atol=2e-15 * size)
        np.testing.assert_array_equal(pose[3], [0, 0, 0, 1])
