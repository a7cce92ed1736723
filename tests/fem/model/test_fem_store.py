"""A frame that is saved comes back."""

from pathlib import Path

import numpy as np
import pytest
from frames import BAR, STEEL, bending_hz, frequencies_hz

import fem


class Plank:
    area = 2e-3
    second_moment = 3e-8


def frame():
    mesh = fem.frame_mesh(
        {"a": (0, 0), "joint": (1, 0.2), "b": (2, 0)},
        [("first", "a", "joint", 3), ("second", "joint", "b", 2), ("third", "a", "b", 2)],
        source="frame.msh",
    )
    return fem.StructureModel(
        mesh,
        parts={
            "first": BAR,
            "second": fem.BeamPart(STEEL, fem.CircularSection(0.03, 0.01)),
            "third": fem.BeamPart(STEEL, Plank()),
        },
        supports=[fem.Support("a", ("x", "y"))],
        point_masses=[fem.PointMass("b", 0.3, 0.1)],
        springs=[fem.PointSpring("b", "y", 1e4)],
        hinges=[fem.Hinge("joint", "second")],
        interfaces={"end": fem.Interface("b", "rotation")},
        plane=True,
    )


def test_a_component_comes_back_to_the_last_bit(tmp_path):
    component = fem.assemble(frame())
    component.save(tmp_path / "frame.npz")
    back = fem.Component.load(tmp_path / "frame.npz")
    for name in ("stiffness", "mass"):
        assert abs(getattr(back, name) - getattr(component, name)).max() == 0.0
    assert np.array_equal(back.interfaces["end"], component.interfaces["end"])
    assert back.model.supports == component.model.supports
    assert back.model.hinges == component.model.hinges
    assert back.model.mesh.source == "frame.msh"
    assert [path.name for path in tmp_path.iterdir()] == ["frame.npz"]


def test_a_file_of_a_frame_in_the_earlier_format_is_read():
    """Cantilevers of 1 m of `BAR`, joined by a hinge: their lowest mode is symmetric."""
    component = fem.Component.load(Path(__file__).parents[1] / "data" / "frame_2.npz")
    assert component.model.plane and component.model.mesh.source == "hinged.msh"
    u = np.arange(1.0, len(component.free) + 1.0)
    seen = component.shape(u)[:, [0, 1, 5]].ravel()
    assert seen[seen > 0].tolist() == u[:-1].tolist()  # node by node, the hinge last
    assert frequencies_hz(component, 1)[0] == pytest.approx(bending_hz(1.8751040687), rel=1e-5)


def test_files_that_are_not_models_are_one_sentence(tmp_path):
    with pytest.raises(fem.ModelError, match=r"no.npz: there is no such model file"):
        fem.Component.load(tmp_path / "no.npz")
    path = tmp_path / "other.npz"
    for content in (b"", b"nonsense"):
        path.write_bytes(content)
        with pytest.raises(fem.ModelError, match="is not a file of a saved model"):
            fem.Component.load(path)
    np.savez(path, points=np.zeros(3))
    with pytest.raises(fem.ModelError, match="is not a file of a saved model"):
        fem.Component.load(path)
    fem.assemble(frame()).save(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(fem.ModelError, match="is not a file of a saved model"):
        fem.Component.load(path)


def test_a_folder_that_is_not_there_is_one_sentence_with_the_path_given(tmp_path):
    target = tmp_path / "none" / "frame.npz"
    with pytest.raises(fem.ModelError, match=f"^{target}: cannot be written: no such file or"):
        fem.assemble(frame()).save(target)


def test_file_may_be_read_by_whom_the_system_lets_read_new_files(tmp_path):
    (tmp_path / "ordinary").touch()
    fem.assemble(frame()).save(tmp_path / "frame.npz")
    assert (tmp_path / "frame.npz").stat().st_mode == (tmp_path / "ordinary").stat().st_mode
