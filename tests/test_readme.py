"""The README's examples run as they are printed, one after the other."""

import re
from pathlib import Path

import numpy as np

TEXT = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)


def test_python_examples(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in BLOCKS:
        exec(compile(block, "README.md", "exec"), names)
    rm, found = names["rm"], names["found"]
    assert found.q.shape == (8, 6)
    assert "off by 180 deg" in rm.igm(names["trr"], POSE_B).reason()
    np.testing.assert_allclose(
        rm.igm(names["trr"], POSE_B, mask=[1, 1, 1, 0, 0, 0]).q, [[0.2, 0, 0]], atol=1e-6
    )
    assert rm.igm(names["iiwa"], names["T"], arm_angle=[0.0, 0.5]).q.shape == (2, 8, 7)
    assert names["fast"].reason() == "The motion is met."
    np.testing.assert_allclose(
        rm.dkm(names["rx90"], names["q"], names["fast"].v), [0.1, 0, -0.2, 0, 0, 0.3], atol=1e-12
    )
    np.testing.assert_allclose(names["motion"].q(names["motion"].duration), names["q"])
    assert names["path"].complete
    np.testing.assert_allclose(
        names["base"].reduce(names["W"]) @ names["base"].values(names["rx90"]),
        rm.idm(names["rx90"], names["q"], 0.5 * names["q"], names["q"]),
    )
    assert len(names["base"]) == 58
    assert names["fall"].relative_drift < 1e-8
    assert (tmp_path / "ur5.html").stat().st_size > 500_000
    assert (tmp_path / "arm.urdf").is_file()
    assert names["result"].after.summary("m").mean < 0.22e-3
    assert names["result"].before.summary("m").mean > 8e-3
    tx40 = names["tx40"]
    assert len(tx40.names) == 61
    assert abs(tx40.value("ZZ1") - 1.23) < 0.01
    assert 0.025 < tx40.deviation("ZZ1") < 0.035
    np.testing.assert_allclose(tx40.held_out.rmse, [4.1, 5.1, 1.5, 0.6, 1.3, 1.3], atol=0.05)
    assert names["real"].inertia.is_physical.all()
    printed = capsys.readouterr().out
    assert "rx90" in printed
    assert "elbow: C3 = 0" in printed
    assert "Dynamic identification of tx40" in printed


POSE_B = [[-1, 0, 0, 0.4], [0, 1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1]]
