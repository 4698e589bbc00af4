"""Models: base parameters and regressors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import EXAMPLES

import rigident

ARM = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0.02 0.01 0.15"/><mass value="3"/>
<inertia ixx="0.03" iyy="0.03" izz="0.008" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0 0.01 0.1"/><mass value="1.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="60" velocity="3"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.3" rpy="0.3 0 0"/>
<axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="30" velocity="3"/></joint>
</robot>"""


@pytest.fixture
def arm(tmp_path: Path) -> rigident.Model:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    return rigident.Model(path)


def test_base_and_standard_parameters_say_the_same_efforts(arm: rigident.Model) -> None:
    assert arm.links == ("base", "upper", "lower")
    assert arm.joints == (("shoulder", 1, 1), ("elbow", 1, 1))
    random = np.random.default_rng(3)
    q, v, a = (random.normal(size=(20, 2)) for _ in range(3))
    standard = arm.regressor(q, v, a)
    assert standard.shape == (20, 2, 30)
    base = arm.base_parameters()
    assert base.standard == arm.standard[10:]
    in_base = arm.regressor(q, v, a, in_base_parameters=True)
    assert in_base.shape == (20, 2, len(base.names))
    efforts = standard @ arm.nominal
    # Products and sums of numbers of the size of the efforts, a hundred at most.
    allowed = 100 * np.finfo(float).eps * np.abs(efforts).max()
    assert np.abs(in_base @ (base.map @ arm.nominal[10:]) - efforts).max() < allowed


def test_an_arm_at_rest_carries_its_weight(arm: rigident.Model) -> None:
    efforts = arm.regressor([0.0, 0.0], [0.0, 0.0], [0.0, 0.0])[0] @ arm.nominal
    g = 9.80665
    # The shoulder's y: weight times what is before it along x.
    assert efforts[0] == pytest.approx(-g * 3 * 0.02, rel=1e-12)
    rows = arm.regressor([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], rows="both")
    assert rows.shape == (1, 8, 30)
    assert (rows[0] @ arm.nominal)[2] == pytest.approx(4.5 * g, rel=1e-12)


def test_arrays_of_other_shapes_are_refused(arm: rigident.Model) -> None:
    with pytest.raises(ValueError, match="2 positions and 2 rates, the arrays 3, 2 and 2"):
        arm.regressor([0.0] * 3, [0.0] * 2, [0.0] * 2)
    with pytest.raises(ValueError, match="not the same rows"):
        arm.regressor(np.zeros((4, 2)), np.zeros((3, 2)), np.zeros((4, 2)))
    with pytest.raises(ValueError, match="sample 2 holds what is not finite"):
        arm.regressor(np.zeros((4, 2)), np.array([[0, 0], [0, 0], [0, np.nan], [0, 0]]), np.zeros((4, 2)))
    with pytest.raises(ValueError, match="samples × numbers"):
        arm.regressor(np.zeros((4, 2, 1)), np.zeros((4, 2)), np.zeros((4, 2)))
    with pytest.raises(ValueError, match="'base', 'joint' or 'both'"):
        arm.regressor([0.0] * 2, [0.0] * 2, [0.0] * 2, rows="wrist")  # type: ignore[arg-type]


def test_bad_models_are_refused(tmp_path: Path) -> None:
    with pytest.raises(rigident.RigidentError, match="nowhere"):
        rigident.Model("nowhere.urdf")
    with pytest.raises(rigident.RigidentError, match="J1,J2,J3"):
        rigident.Model("human34", spherical="a,b")
    with pytest.raises(rigident.RigidentError):
        rigident.Model(EXAMPLES / "two-links.rig.toml", lock="no_such_joint")
