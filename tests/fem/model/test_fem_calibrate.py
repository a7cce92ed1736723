"""Fitting unknown dimensions."""

import math

import calibrate_beam
import make_meshes
import numpy as np
import pytest

import fem


def line(unknowns):
    return {f"y{x}": unknowns["offset"] + unknowns["slope"] * x for x in range(4)}


LINE_START = {"offset": 0.3, "slope": 2.0}
LINE_TARGETS = {"y0": 1.1, "y1": 2.9, "y2": 5.1, "y3": 6.9}
LINE_TOLERANCES = {"y0": 0.1, "y1": 0.2, "y2": 0.1, "y3": 0.4}


def test_a_line_is_fitted_as_the_normal_equations_say():
    fit = fem.calibrate(line, LINE_START, LINE_TARGETS, LINE_TOLERANCES)
    weights = 3 / np.array(list(LINE_TOLERANCES.values())) ** 2
    X = np.stack([np.ones(4), np.arange(4)], axis=1)
    normal = X.T @ (weights[:, None] * X)
    wanted = np.array(list(LINE_TARGETS.values()))
    expected = np.linalg.solve(normal, X.T @ (weights * wanted))
    chi_square = weights @ (X @ expected - wanted) ** 2
    covariance = np.linalg.inv(normal) * max(1.0, chi_square / 2)
    assert list(fit.values.values()) == pytest.approx(expected, rel=1e-9)
    assert fit.chi_square == pytest.approx(chi_square, rel=1e-9)
    assert fit.degrees_of_freedom == 2
    assert fit.covariance == pytest.approx(covariance, rel=1e-7)
    assert list(fit.standard_uncertainties.values()) == pytest.approx(
        np.sqrt(np.diag(covariance)), rel=1e-7
    )
    assert fit.jacobian == pytest.approx(X, abs=1e-8)
    assert fit.converged


def test_rounded_values_scatter_as_the_uncertainty_says():
    """Fit many rounded copies of the same line; the spread of the fits is the uncertainty."""
    random = np.random.default_rng(0)
    slopes, digit = [], 0.1
    for _ in range(300):
        truth = {"offset": random.uniform(0, 1), "slope": random.uniform(1, 2)}
        rounded = {name: digit * round(y / digit) for name, y in line(truth).items()}
        fit = fem.calibrate(line, LINE_START, rounded, dict.fromkeys(rounded, digit / 2))
        slopes.append(fit.values["slope"] - truth["slope"])
    sigma = digit / math.sqrt(12) / math.sqrt(5.0)
    assert np.std(slopes) == pytest.approx(sigma, rel=0.15)


def test_an_unknown_that_no_target_sees_has_infinite_uncertainty():
    def predict(unknowns):
        return {"a": 2 * unknowns["seen"], "b": 3 * unknowns["seen"]}

    fit = fem.calibrate(
        predict, {"seen": 1.0, "unseen": 1.0}, {"a": 4.0, "b": 6.0}, {"a": 0.1, "b": 0.1}
    )
    assert fit.values["seen"] == pytest.approx(2.0, rel=1e-9)
    assert fit.standard_uncertainties["unseen"] == math.inf
    assert fit.standard_uncertainties["seen"] < 0.1


def test_bounds_hold():
    fit = fem.calibrate(
        line, LINE_START, LINE_TARGETS, LINE_TOLERANCES, bounds={"slope": (0.0, 2.0)}
    )
    assert fit.values["slope"] <= 2.0


def test_the_dimensions_of_a_cantilever_come_back_from_its_own_frequencies():
    from frames import BAR, CLAMP, frequencies_hz

    def predict(unknowns):
        mesh = fem.frame_mesh({"a": (0, 0), "b": (unknowns["length"], 0)}, [("bar", "a", "b", 6)])
        model = fem.StructureModel(
            mesh,
            {"bar": BAR},
            [fem.Support("a", CLAMP)],
            [fem.PointMass("b", unknowns["mass"])],
            plane=True,
        )
        return dict(zip("123", frequencies_hz(fem.assemble(model), 3).tolist(), strict=True))

    truth = {"length": 0.83, "mass": 0.4}
    targets = predict(truth)
    tolerances = {name: 1e-3 * value for name, value in targets.items()}
    bounds = {"length": (0.1, 3.0), "mass": (0.01, 5.0)}
    fit = fem.calibrate(predict, {"length": 1.0, "mass": 1.0}, targets, tolerances, bounds)
    assert fit.values == pytest.approx(truth, rel=1e-6)


def test_tables_show_every_value():
    fit = fem.calibrate(line, LINE_START, LINE_TARGETS, LINE_TOLERANCES)
    assert len(fit.table().splitlines()) == 2 + 4
    assert "| y2 | 5.1 |" in fit.table()
    assert "| slope |" in fit.unknowns_table()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"start": {}}, "there is no unknown"),
        ({"targets": {"y0": 1.0}, "tolerances": {"y0": 1.0}}, "at least as many targets"),
        ({"tolerances": {"y0": 0.1}}, "'y1' is in one"),
        ({"tolerances": {**LINE_TOLERANCES, "y1": 0.0}}, "tolerance of 'y1' must be positive"),
        ({"targets": {**LINE_TARGETS, "y1": math.nan}}, "target of 'y1' must be finite"),
        ({"start": {"offset": math.inf, "slope": 1.0}}, "start of 'offset' must be finite"),
        ({"bounds": {"slop": (0.0, 1.0)}}, "bounds for 'slop'"),
        ({"bounds": {"slope": (3.0, 4.0)}}, "not within its bounds"),
        ({"step": 0.0}, "step must be between 0 and 1"),
        ({"predict": lambda unknowns: {"y0": 1.0}}, "does not give 'y1'"),
        ({"predict": lambda unknowns: dict.fromkeys(LINE_TARGETS, math.nan)}, "is not finite at"),
    ],
)
def test_a_bad_request_is_one_sentence(change, sentence):
    request = {
        "predict": line,
        "start": LINE_START,
        "targets": LINE_TARGETS,
        "tolerances": LINE_TOLERANCES,
    }
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        fem.calibrate(**{**request, **change})
    assert "\n" not in str(caught.value)


def predicted_at_shipped_dimensions():
    dimensions = make_meshes.read_dimensions()
    mesh = fem.read_mesh(make_meshes.HERE / "half_beam.msh")
    model = make_meshes.half_beam_model(mesh, dimensions.middle_mass)
    return calibrate_beam.predict(fem.assemble(model))


def test_shipped_beam_meets_all_seven_published_values_within_a_fifth_of_a_per_cent():
    predicted = predicted_at_shipped_dimensions()
    for name, published in calibrate_beam.PUBLISHED.items():
        assert predicted[name] == pytest.approx(published, rel=2e-3), name


def test_shipped_dimensions_are_a_minimum():
    """The gradient of the sum of squares vanishes there, on the scale of the uncertainties."""
    dimensions = make_meshes.read_dimensions()
    unknowns = {name: getattr(dimensions, name) for name in calibrate_beam.START}
    sigma = {"beam_length": 4e-4, "leaf_length": 2e-3, "middle_mass": 8e-3}

    def cost(name, step):
        values = calibrate_beam.upright({**unknowns, name: unknowns[name] + step * sigma[name]})
        return sum(
            ((values[key] - target) / calibrate_beam.TOLERANCES[key]) ** 2
            for key, target in calibrate_beam.PUBLISHED.items()
        )

    for name in unknowns:
        slope = (cost(name, 0.1) - cost(name, -0.1)) / 0.2
        assert abs(slope) < 1e-2, name


def test_documented_values_are_those_of_the_shipped_beam():
    text = calibrate_beam.DOCUMENT.read_text(encoding="utf-8")
    block = text.split("<!-- calibrated -->")[1].split("<!-- end of calibrated -->")[0]
    for name, value in predicted_at_shipped_dimensions().items():
        row = next(line for line in block.splitlines() if line.startswith(f"| {name} |"))
        assert float(row.split("|")[3]) == pytest.approx(value, rel=1e-5)
