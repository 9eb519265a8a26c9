"""The example that goes through the whole book, with few touches and a short log."""

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "notebooks" / "one_robot.py"


def test_one_robot_from_its_urdf_to_c(tmp_path, capsys):
    spec = importlib.util.spec_from_file_location("one_robot", SCRIPT)
    one_robot = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(one_robot)
    found = one_robot.main(small=True, out=tmp_path)
    before, after = "data sheet", "calibrated and identified"
    assert found[f"torque, {after}"] < 0.02 * found[f"torque, {before}"]
    assert found[f"tool, {after}"] < 0.05 * found[f"tool, {before}"]
    assert found[f"tool, {after}"] < 2.0  # mm
    assert found["C program"] < 1e-10
    assert "void ur5e_idm(" in (tmp_path / "ur5e_idm.c").read_text(encoding="utf-8")
    printed = capsys.readouterr().out
    for word in ("8 aspects", "The path is followed", "OPTIMAL", "followed to the end"):
        assert word in printed
