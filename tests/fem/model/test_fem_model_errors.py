"""What a model refuses, in one sentence that names the item."""

import math

import pytest
from frames import BAR, CLAMP, STEEL, beam

import fem


def two_bars(**rest):
    mesh = fem.frame_mesh(
        {"a": (0, 0), "joint": (1, 0), "b": (2, 0)},
        [("first", "a", "joint", 2), ("second", "joint", "b", 2)],
        source="bars.msh",
    )
    return fem.StructureModel(mesh, **{"parts": {"first": BAR, "second": BAR}, **rest}, plane=True)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: fem.Material(0.0, 1.0), "material: youngs_modulus must be positive"),
        (lambda: fem.Material(1.0, math.nan), "material: density must be finite and not negative"),
        (lambda: fem.Material("a", 1.0), "material: youngs_modulus must be .* not 'a'"),
        (lambda: fem.Material(None, 1.0), "material: youngs_modulus must be .* not None"),
        (lambda: fem.Material(1.0, True), "material: density must be .* not True"),
        (lambda: fem.Material(1.0, 10**400), "material: density must be finite and not negative"),
        (lambda: fem.CircularSection(0.1, bore="b"), "circular section: bore .* not 'b'"),
        (lambda: fem.PointMass("tip", "m"), "point mass at 'tip': mass must be finite .* not 'm'"),
        (lambda: fem.PointSpring("tip", "y", "k"), "spring at 'tip': stiffness .* not 'k'"),
        (lambda: fem.BeamPart("steel", BAR.section), "part: material must be .* not 'steel'"),
        (lambda: fem.BeamPart(STEEL, 0.1), "part: section must have an area .* not be 0.1"),
        (lambda: fem.Support("foot", 1), "support at 'foot': directions must be a list .* not 1"),
        (lambda: fem.Support("foot", ("x", "x")), "support at 'foot': direction 'x' is given twi"),
        (lambda: fem.RectangularSection(-1.0, 1.0), "rectangular section: width"),
        (lambda: fem.RectangularSection(1.0, math.inf), "rectangular section: height"),
        (lambda: fem.CircularSection(0.0), "circular section: diameter"),
        (lambda: fem.CircularSection(0.1, bore=0.1), "circular section: bore"),
        (lambda: fem.CircularSection(0.1, bore=math.nan), "circular section: bore"),
        (lambda: fem.Section(1.0, -1.0), "section: second_moment"),
        (lambda: fem.Support("foot", ()), "support at 'foot': no direction"),
        (lambda: fem.Support("foot", ("x", "w")), "support at 'foot': there is no direction 'w'"),
        (lambda: fem.PointMass("tip", -1.0), "point mass at 'tip': mass must be finite and not"),
        (lambda: fem.PointMass("tip", math.nan), "point mass at 'tip': mass"),
        (lambda: fem.PointMass("tip", 1.0, -1.0), "point mass at 'tip': rotary inertia"),
        (lambda: fem.PointMass("tip", 0.0), "point mass at 'tip': mass and rotary inertia are"),
        (lambda: fem.PointSpring("tip", "w", 1.0), "spring at 'tip': there is no direction 'w'"),
        (lambda: fem.PointSpring("tip", "y", 0.0), "spring at 'tip': stiffness must be positive"),
        (lambda: fem.Interface("tip", "up"), "interface at 'tip': there is no direction 'up'"),
        (
            lambda: two_bars(supports=[fem.Support("c", "x")]),
            "bars.msh: there is no point or face 'c'; there are 'a', 'joint', 'b', 'first'",
        ),
        (lambda: two_bars(point_masses=[fem.PointMass("c", 1.0)]), "there is no point or face 'c'"),
        (
            lambda: two_bars(springs=[fem.PointSpring("c", "x", 1.0)]),
            "there is no point or face 'c'",
        ),
        (lambda: two_bars(hinges=[fem.Hinge("c", "first")]), "there is no point or face 'c'"),
        (
            lambda: two_bars(interfaces={"i": fem.Interface("c", "x")}),
            "there is no point or face 'c'",
        ),
        (
            lambda: two_bars(parts={"first": BAR, "secnd": BAR}),
            "bars.msh: there is no part 'secnd'; there are 'first', 'second'",
        ),
        (
            lambda: two_bars(parts={"first": BAR}),
            "bars.msh: line 2 is in no part of the model, whose parts are 'first'",
        ),
        (
            lambda: fem.StructureModel(None, {}, plane=True),
            "model: mesh must be a StructureMesh, not None",
        ),
        (
            lambda: two_bars(supports=fem.Support("a", "x")),
            r"bars.msh: supports must be a list of Support, not Support\(point='a'",
        ),
        (
            lambda: two_bars(springs=[fem.PointMass("a", 1.0)]),
            r"bars.msh: springs must be a list of PointSpring, not \[PointMass\(",
        ),
        (
            lambda: two_bars(parts=["first"]),
            r"parts must be a dictionary by name, of BeamPart, .*, not \['first'\]",
        ),
        (
            lambda: two_bars(interfaces={"tip": ("a", "y")}),
            "bars.msh: interfaces must be a dictionary by name, of Interface",
        ),
        (lambda: two_bars(parts={}), "line 0 is in no part of the model, whose parts are none"),
        (
            lambda: two_bars(hinges=[fem.Hinge("b", "first")]),
            "no line of part 'first' meets the hinge at 'b'",
        ),
        (
            lambda: two_bars(hinges=[fem.Hinge("joint", "third")]),
            "hinge at 'joint': 'third' is no beam part",
        ),
        (
            lambda: fem.assemble(
                two_bars(hinges=[fem.Hinge("joint", "first"), fem.Hinge("joint", "second")])
            ),
            "nothing is joined to the direction 'rotation_z' of point 'joint'; support it",
        ),
        (
            lambda: fem.assemble(two_bars(hinges=[fem.Hinge("a", "first")])),
            "nothing is joined to the direction 'rotation_z' of point 'a'",
        ),
        (
            lambda: two_bars(hinges=[fem.Hinge("joint", "first"), fem.Hinge("joint", "first")]),
            "the hinge of part 'first' at 'joint' is given twice",
        ),
        (
            lambda: fem.assemble(
                two_bars(
                    supports=[fem.Support("a", CLAMP)], interfaces={"root": fem.Interface("a", "y")}
                )
            ),
            "interface 'root' is on direction 'y' of point 'a', which a support holds",
        ),
    ],
)
def test_a_bad_model_is_one_sentence(make, sentence):
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_frame_must_lie_in_one_plane():
    mesh = fem.frame_mesh({"a": (0, 0, 0), "b": (1, 0, 0.1)}, [("bar", "a", "b", 2)], "out.msh")
    with pytest.raises(fem.ModelError, match=r"out.msh: .* one z .* from 0 to 0.1"):
        fem.StructureModel(mesh, {"bar": BAR}, plane=True)


def test_the_plane_may_be_anywhere():
    mesh = fem.frame_mesh({"a": (0, 0, 7), "b": (1, 0, 7)}, [("bar", "a", "b", 2)])
    there = fem.assemble(fem.StructureModel(mesh, {"bar": BAR}, plane=True))
    here = fem.assemble(beam(elements=2))
    assert abs(there.stiffness - here.stiffness).max() == 0.0


def test_a_point_of_several_nodes_cannot_be_used_but_may_be_there():
    mesh = fem.StructureMesh(
        [[0, 0, 0], [1, 0, 0]],
        {"line": [[0, 1]]},
        {"bar": {"line": [0]}},
        {"ends": [0, 1]},
        source="bar.msh",
    )
    fem.StructureModel(mesh, {"bar": BAR}, plane=True)
    with pytest.raises(fem.ModelError, match="'ends' must be a single point, but holds 2 nodes"):
        fem.StructureModel(
            mesh, {"bar": BAR}, point_masses=[fem.PointMass("ends", 1.0)], plane=True
        )


def test_a_support_holds_all_points_of_a_set():
    points = {"left": [0], "middle": [1], "right": [2], "ends": [0, 2]}
    mesh = fem.StructureMesh(
        [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
        {"line": [[0, 1], [1, 2]]},
        {"bar": {"line": [0, 1]}},
        points,
    )
    apart = [fem.Support("left", CLAMP), fem.Support("right", CLAMP)]
    found, exact = (
        fem.assemble(
            fem.StructureModel(mesh, {"bar": BAR}, supports, plane=True)
        ).stiffness.toarray()
        for supports in ([fem.Support("ends", CLAMP)], apart)
    )
    assert found.shape == (3, 3)
    assert (found == exact).all()
    with pytest.raises(fem.ModelError, match="which a support holds"):
        fem.assemble(
            fem.StructureModel(
                mesh,
                {"bar": BAR},
                supports=[fem.Support("ends", "y")],
                interfaces={"end": fem.Interface("right", "y")},
                plane=True,
            )
        )


def test_supports_that_hold_everything_leave_nothing_to_assemble():
    supports = [fem.Support("left", CLAMP), fem.Support("right", CLAMP)]
    with pytest.raises(fem.ModelError, match="hold every degree of freedom"):
        fem.assemble(beam(elements=1, supports=supports))


def test_a_displacement_of_another_size_is_refused():
    component = fem.assemble(beam(elements=1))
    with pytest.raises(fem.ModelError, match=r"has shape \(6,\), not \(5,\)"):
        component.shape([0.0] * 5)


def test_sections_have_the_area_and_second_moment_of_the_handbook():
    tube = fem.CircularSection(0.04, bore=0.03)
    assert tube.area == pytest.approx(math.pi * (0.02**2 - 0.015**2), rel=1e-15)
    assert tube.second_moment == pytest.approx(math.pi / 4 * (0.02**4 - 0.015**4), rel=1e-14)
    # a box is the difference of two rectangles
    outer, inner = fem.RectangularSection(0.05, 0.08), fem.RectangularSection(0.04, 0.07)
    assert outer.second_moment == pytest.approx(0.05 * 0.08**3 / 12, rel=1e-15)
    box = fem.Section(outer.area - inner.area, outer.second_moment - inner.second_moment)
    assert fem.BeamPart(STEEL, box).section.area == pytest.approx(0.05 * 0.08 - 0.04 * 0.07)
