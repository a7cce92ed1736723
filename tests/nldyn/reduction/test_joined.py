"""Convergence studies of joined components, against the whole that they make."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.linalg import block_diag, eigh, null_space

import cms
from nldyn import LoadCase, SceneError, Stop, SystemModelError, Unbalance, convergence_study
from nldyn.app.cli import main
from nldyn.base.resources import example
from nldyn.reduction import JoinedComponents, model_errors, studied
from nldyn.reduction.model_errors import largest_force, measured_linear
from nldyn.reduction.studied import receptance_bound
from nldyn.report.convergence import write_study
from nldyn.report.offline import unpacked
from nldyn.scene.convergence import convergence_study_of
from nldyn.scene.read import load_scene, parse_scene

MASS, SPRING, LEFT, RIGHT = 0.05, 20000.0, 5, 8
SETTING = LoadCase(
    (30.5, 36.0),
    stops=(Stop("b.end", stiffness=2e7),),
    excitation=(Unbalance("b.end", 2e-4),),
    modal_damping=0.03,
    observe="b.end",
)
JOINTS = [cms.Joint(("a", "end"), ("b", "end"))]


def chain(count: int, at: int, halved: bool):
    """Masses between two walls; a halved one is cut at the mass ``at``, where nothing holds it."""
    K = SPRING * (2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1))
    M = MASS * np.eye(count)
    if halved:
        K[at, at], M[at, at] = SPRING, MASS / 2
    return cms.Matrices(K, M, {"end": np.eye(count)[at]})


A, B = chain(LEFT, LEFT - 1, halved=True), chain(RIGHT, 0, halved=True)
WHOLE = chain(LEFT + RIGHT - 1, LEFT - 1, halved=False)


@pytest.fixture(scope="module")
def study():
    joined = JoinedComponents({"a": A, "b": B}, JOINTS)
    return convergence_study(joined, SETTING, modes=(1, 2, 8), methods=("rubin", "truncation"))


def test_the_reference_has_the_frequencies_of_the_whole_chain(study):
    """2 √(k/m) sin(n π/26) of 12 masses between two walls; the 13 is prime, so all are seen."""
    n = np.arange(1, LEFT + RIGHT)
    exact = 2 * np.sqrt(SPRING / MASS) * np.sin(n * np.pi / 26) / (2 * np.pi)
    assert study.reference.frequencies_hz == pytest.approx(exact, rel=1e-9)
    assert (study.reference.label, study.reference.modes) == ("full", 12)


def test_with_all_modes_the_branch_is_that_of_the_whole_chain(study):
    """Of the chain as one component that is not reduced."""
    setting = replace(
        SETTING,
        stops=(Stop("end", stiffness=2e7),),
        excitation=(Unbalance("end", 2e-4),),
        observe="end",
    )
    alone = convergence_study(WHOLE, setting, modes=(12,)).best
    assert study.is_exact(study.best) and study.best.modes == 8
    assert study.best.peak.frequency_hz == pytest.approx(alone.peak.frequency_hz, rel=1e-6)
    size = alone.peak.max_abs_displacement
    assert study.best.peak.max_abs_displacement == pytest.approx(size, rel=1e-6)
    force = largest_force(alone.orbit)
    assert force > 0.0
    assert largest_force(study.best.orbit) == pytest.approx(force, rel=1e-6)
    for kind, places in alone.special_values.items():
        assert study.best.special_values[kind] == pytest.approx(places, rel=1e-6)


@pytest.mark.parametrize("method, residual", [("rubin", 1), ("truncation", 0)])
def test_the_errors_are_those_of_a_ritz_basis_on_the_joined_matrices(study, method, residual):
    """Kept modes and static shapes of both halves, side by side and joined, projected."""
    K, M = block_diag(A.stiffness, B.stiffness), block_diag(A.mass, B.mass)
    apart = np.concatenate([A.interfaces["end"], -B.interfaces["end"]])
    exact = np.sqrt(eigh(WHOLE.stiffness, WHOLE.mass, eigvals_only=True)[:3])
    for index in study.series()[method][:2]:
        count = study.models[index].modes
        shapes = [
            np.column_stack(
                [eigh(each.stiffness, each.mass)[1][:, :count]]
                + [np.linalg.solve(each.stiffness, each.interfaces["end"])] * residual
            )
            for each in (A, B)
        ]
        basis = block_diag(*shapes)
        basis = basis @ null_space(apart[None] @ basis)
        found = np.sqrt(eigh(basis.T @ K @ basis, basis.T @ M @ basis, eigvals_only=True))
        compared = min(3, len(found))
        error = np.max(found[:compared] / exact[:compared] - 1.0)
        assert error > 1e-6
        assert study.errors[index].eigenfrequency == pytest.approx(error, rel=1e-4)


def test_a_component_with_fewer_modes_keeps_all(study):
    assert [(m.modes, m.size) for m in study.models if m.method == "rubin"] == [
        (1, 3), (2, 5), (8, 12),
    ]  # fmt: skip
    said = study.report()
    assert "counted in each component ('a', 'b'); one with fewer keeps all that it has" in said
    assert "rubin with 8 modes leaves nothing out" in said


def test_what_is_kept_as_it_is_is_the_same_in_the_reference(tmp_path):
    """Two modes of a, so that the whole has those of the chain whose left part has two."""
    two = cms.reduce(A, modes=2)
    setting = replace(SETTING, limits=(35.5, 36.0))
    study = convergence_study(JoinedComponents({"b": B}, JOINTS, {"a": two}), setting, modes=(2, 8))
    whole = cms.couple({"a": two, "b": cms.reduce(B, modes=8)}, JOINTS)
    assert study.reference.frequencies_hz == pytest.approx(whole.frequencies_hz, rel=1e-9)
    assert [model.size for model in study.models] == [5, 10, 10]
    assert "in the component 'b'; the same in all models: 'a'" in study.report()
    write_study(study, tmp_path)
    page = unpacked((tmp_path / "convergence.html").read_text(encoding="utf-8"))
    assert page["reference"][-1].endswith("the same in all models: 'a'")


def test_the_bound_of_a_reduced_reference_holds(monkeypatch):
    monkeypatch.setattr(studied, "ALL_MODES_UP_TO", 10)
    monkeypatch.setattr(model_errors, "FEWEST_REFERENCE_MODES", 3)
    setting, grid = replace(SETTING, modal_damping=0.0), np.linspace(*SETTING.range_hz, 400)
    joined = JoinedComponents({"a": A, "b": B}, JOINTS)
    known = joined.reference(1)
    assert not known.full
    linear = measured_linear("", "reference", known.whole, setting)
    bound = receptance_bound(joined, known, linear, setting)
    end = WHOLE.interfaces["end"]
    exact = [
        end @ np.linalg.solve(WHOLE.stiffness - (2 * np.pi * hz) ** 2 * WHOLE.mass, end)
        for hz in grid
    ]
    error = np.linalg.norm(linear.receptance - exact) / np.linalg.norm(linear.receptance)
    assert 0.3 * bound < error < bound < np.inf


@pytest.mark.parametrize("method", ["craig-bampton", "macneal", "guyan"])
def test_every_method_joins(method):
    """The more modes, the nearer to the chain; by Guyan's method there is one model."""
    joined = JoinedComponents({"a": A, "b": B}, JOINTS)
    models = joined.reductions([1, 2, 3], method)
    exact = np.sqrt(eigh(WHOLE.stiffness, WHOLE.mass, eigvals_only=True)[0]) / (2 * np.pi)
    errors = [abs(model.frequencies_hz[0] / exact - 1.0) for model in models]
    assert len(models) == (1 if method == "guyan" else 3)
    assert errors == sorted(errors, reverse=True) and errors[-1] < (
        0.2 if len(models) == 1 else 1e-3
    )


def test_what_makes_no_sense_is_told():
    joined = JoinedComponents({"a": A, "b": B}, JOINTS)
    assert repr(joined) == "<JoinedComponents 'a', 'b', 1 joint>"
    with pytest.raises(SystemModelError, match="none is given that can be reduced"):
        JoinedComponents({}, JOINTS, {"a": cms.reduce(A, modes=2)})
    with pytest.raises(SystemModelError, match="'a' cannot be both reduced and kept"):
        JoinedComponents({"a": A}, [], {"a": cms.reduce(A, modes=2)})
    with pytest.raises(
        cms.ReductionError, match=r"modes = 9, but .* none has more than 8 by 'rubin'"
    ):
        convergence_study(joined, SETTING, modes=(9,))
    free = cms.Matrices(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(2), {"end": [1.0, 0.0]})
    with pytest.raises(cms.ReductionError, match="component 'b': modes = 0, but the component flo"):
        JoinedComponents({"a": A, "b": free}, JOINTS).reductions([0], "rubin")


SCENE = example("portal_with_absorber.toml")


def portal(folder):
    """The scene with a short range."""
    text = SCENE.read_text(encoding="utf-8").replace("[8.0, 18.0]", "[17.5, 18.0]")
    text = text.replace("../../meshes/", (SCENE.parent / "../../meshes").resolve().as_posix() + "/")
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return folder / "scene.toml"


def test_the_counts_of_a_scene_are_those_of_its_components_that_are_reduced(tmp_path):
    """The absorber has no [reduction]; chosen by name it is varied, too."""
    scene = load_scene(portal(tmp_path))
    study = convergence_study_of(scene, modes=(2, 3))
    assert "component 'frame'; the same in all models: 'absorber'" in study.report()
    chosen = convergence_study_of(scene, modes=(1, 2), components=("absorber",))
    assert "component 'absorber'; the same in all models: 'frame'" in chosen.report()
    assert chosen.is_exact(chosen.best)


def test_the_command_writes_a_page(tmp_path):
    arguments = [str(portal(tmp_path)), "--out", str(tmp_path / "out"), "--quiet"]
    told = CliRunner().invoke(main, ["converge", *arguments, "--modes", "2-3"])
    assert told.exit_code == 0, told.output
    assert "modes are counted in the component 'frame'" in told.stdout
    assert (tmp_path / "out" / "convergence.html").is_file()
    told = CliRunner().invoke(main, ["converge", *arguments, "--components", "frames"])
    assert told.exit_code == 2 and told.stderr.count("\n") == 1
    assert "each component must be one of frame, absorber, got 'frames'" in told.stderr


MATRICES = """
[matrices]
mass = [[1.0, 0.0], [0.0, 1.0]]
stiffness = [[2e4, -1e4], [-1e4, 2e4]]
interfaces.end = [0.0, 1.0]
[reduction]
modes = 1
[[stops]]
at = "end"
stiffness = 1e5
law = "linear"
[[excitation]]
at = "end"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [29.0, 30.0]
[damping]
modal_ratio = 0.05
"""


def test_matrices_that_are_reduced_can_be_studied():
    """√(1e4) and √(3e4) rad/s."""
    study = convergence_study_of(parse_scene(MATRICES), modes=(1, 2))
    exact = np.sqrt([1e4, 3e4]) / (2 * np.pi)
    assert study.reference.frequencies_hz == pytest.approx(exact, rel=1e-12)
    assert study.is_exact(study.best)


@pytest.mark.parametrize(
    "old, new, options, words",
    [
        ("", "", {"components": ("a",)}, "components are for a scene that joins several"),
        ("", "", {"refinements": (1, 2)}, "refinements cut meshes; this scene has matrices"),
        ("", "", {"meshes": ("a.msh",)}, "meshes are for a scene of one component with a mesh"),
        ("interfaces", "gyroscopic = [[0, 1], [-1, 0]]\ninterfaces", {},
         "matrices.gyroscopic couples the modes, which a convergence study does not know"),
    ],
)  # fmt: skip
def test_options_that_a_scene_does_not_take_are_told(old, new, options, words):
    with pytest.raises((SceneError, SystemModelError)) as caught:
        convergence_study_of(parse_scene(MATRICES.replace(old, new, 1)), **options)
    assert words in str(caught.value)


def test_joined_components_of_which_none_is_reduced_are_told():
    apart = MATRICES.replace("[matrices]", "[components.a.matrices]").replace('"end"', '"a.end"')
    scene = parse_scene(apart.replace("[reduction]\nmodes = 1\n", ""))
    with pytest.raises(
        SceneError, match=r"components are not reduced: none has a \[components.NAM"
    ):
        convergence_study_of(scene)
