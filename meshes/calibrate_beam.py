"""Calibrate the dimensions of the beam that the paper's text does not give.

Run as ``python meshes/calibrate_beam.py`` to see the fit, with ``--write`` to write
half_beam.toml, the meshes and the tables in docs/how-to/calibration.md. It takes half a minute;
many threads in the linear algebra slow it down (set OPENBLAS_NUM_THREADS=1).
"""

from __future__ import annotations

import argparse
import math
import re
import time
from dataclasses import asdict
from functools import partial
from pathlib import Path

import make_meshes
from make_meshes import BEAM, DIMENSIONS, Dimensions

import cms
import fem

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "how-to" / "calibration.md"

PUBLISHED = {
    "f1 (Hz)": 13.1,
    "f2 (Hz)": 117.5,
    "f3 (Hz)": 326.5,
    "modal mass of mode 1 (kg)": 2.48,
    "modal stiffness of mode 1 (N/m)": 16877.0,
    "second frequency of the 2-DOF model (Hz)": 125.1,
    "fourth frequency of the 4-DOF model (Hz)": 749.5,
}
"""From the paper "Periodic solutions of a multi-DOF beam system with impact": equation (3.1) and
the beginnings of its sections 4 and 5."""

ROUNDING = dict(zip(PUBLISHED, (0.05, 0.05, 0.05, 0.005, 0.5, 0.05, 0.05), strict=True))
"""Half a unit of the last printed digit."""

MODEL_ERROR = 1e-3
"""Relative half-width allowed for what the model itself leaves out."""

TOLERANCES = {
    name: math.hypot(ROUNDING[name], MODEL_ERROR * value) for name, value in PUBLISHED.items()
}

START = {"beam_length": 1.32, "leaf_length": 0.113, "middle_mass": 0.377}


def predict(component: fem.Component) -> dict[str, float]:
    """The seven published values from a model of the half beam."""
    four = cms.reduce(component, modes=3)
    two = cms.reduce(component, modes=1)
    modal_mass = float(four.participation["middle"][0]) ** -2
    f1, f2, f3, f4 = four.frequencies_hz.tolist()
    stiffness = modal_mass * (2 * math.pi * f1) ** 2
    values = (f1, f2, f3, modal_mass, stiffness, float(two.frequencies_hz[1]), f4)
    return dict(zip(PUBLISHED, values, strict=True))


def upright(unknowns: dict[str, float]) -> dict[str, float]:
    """Leaf springs upright under the ends of the beam."""
    dimensions = Dimensions(**unknowns)
    mesh = make_meshes.half_beam_mesh(dimensions)
    return predict(fem.assemble(make_meshes.half_beam_model(mesh, dimensions.middle_mass)))


def lying_flat(unknowns: dict[str, float]) -> dict[str, float]:
    """Leaf springs flat, in line with the beam."""
    dimensions = Dimensions(**unknowns)
    mesh = make_meshes.half_beam_mesh(dimensions)
    leaf = mesh.points[:, 1] < 0
    points = mesh.points.copy()
    points[leaf] = points[leaf][:, [1, 0, 2]]
    model = make_meshes.half_beam_model(mesh.with_points(points), dimensions.middle_mass)
    return predict(fem.assemble(model))


def upright_with_free_constant(constant: str, unknowns: dict[str, float]) -> dict[str, float]:
    """Upright leaf springs, and one published constant of the beam multiplied with a factor.

    `constant` is "height", "density" or "Young's modulus".
    """
    rest = {name: value for name, value in unknowns.items() if name != constant}
    factor = unknowns[constant]
    dimensions = Dimensions(**rest)
    material, section = BEAM.material, BEAM.section
    if constant == "height":
        section = fem.RectangularSection(section.width, factor * section.height)
    elif constant == "density":
        material = fem.Material(material.youngs_modulus, factor * material.density)
    else:
        material = fem.Material(factor * material.youngs_modulus, material.density)
    model = make_meshes.half_beam_model(
        make_meshes.half_beam_mesh(dimensions),
        dimensions.middle_mass,
        beam=fem.BeamPart(material, section),
    )
    return predict(fem.assemble(model))


def free_constants(start: dict[str, float]) -> str:
    """A Markdown table of the fits with a fourth unknown, within the printed digits alone."""
    rows = [
        "| fourth unknown | its change | chi² | largest deviation |",
        "| --- | ---: | ---: | ---: |",
    ]
    for constant in ("height", "density", "Young's modulus"):
        fit = fem.calibrate(
            partial(upright_with_free_constant, constant),
            {**start, constant: 1.0},
            PUBLISHED,
            ROUNDING,
        )
        change, sigma = fit.values[constant] - 1.0, fit.standard_uncertainties[constant]
        worst = max(abs(deviation) for deviation in fit.deviations.values())
        rows.append(
            f"| {constant} of the beam | {100 * change:+.2f} ± {100 * sigma:.2f} %"
            f" | {fit.chi_square:.3g} | {100 * worst:.2f} % |"
        )
    return "\n".join(rows)


def calibrated() -> fem.Calibration:
    """The calibration that the meshes are made from."""
    return fem.calibrate(upright, START, PUBLISHED, TOLERANCES)


def write_dimensions(dimensions: Dimensions, path: Path = DIMENSIONS) -> None:
    """Write half_beam.toml."""
    units = {
        "beam_length": "m, both halves",
        "leaf_length": "m",
        "middle_mass": "kg, whole beam",
    }
    rows = ["# Dimensions of the paper's beam that its text does not give: calibrated, see"]
    rows += ["# docs/how-to/calibration.md; written by calibrate_beam.py."]
    rows += [f"{name} = {value!r}  # {units[name]}" for name, value in asdict(dimensions).items()]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def with_block(text: str, name: str, content: str) -> str:
    """Replace what stands between the two markers of a block in a Markdown text."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    pattern = re.escape(begin) + ".*?" + re.escape(end)
    if not re.search(pattern, text, flags=re.DOTALL):
        raise ValueError(f"there is no block {name!r}")
    block = f"{begin}\n{content}\n{end}"
    return re.sub(pattern, lambda _: block, text, flags=re.DOTALL)


def quality(fit: fem.Calibration) -> str:
    """Chi-square, largest deviation and whether the fit converged, as one line."""
    worst = max(fit.deviations, key=lambda name: abs(fit.deviations[name]))
    ending = "" if fit.converged else f"; not converged: {fit.message}"
    return (
        f"chi² = {fit.chi_square:.3g} with {fit.degrees_of_freedom} degrees of freedom; largest"
        f" deviation {100 * fit.deviations[worst]:+.2g} % ({worst}){ending}"
    )


def report(fit: fem.Calibration) -> str:
    """Unknowns, values and quality of a fit as Markdown."""
    return f"{fit.unknowns_table()}\n\n{fit.table()}\n\n{quality(fit)}"


def main() -> None:
    """Fit, print and, if asked, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write dimensions, meshes and docs")
    write = parser.parse_args().write
    begin = time.perf_counter()
    fit = calibrated()
    flat_bounds = {"leaf_length": (0.001, 1.0), "beam_length": (0.5, 3.0), "middle_mass": (0, 5)}
    blocks = {
        "calibrated": report(fit),
        "rounding only": report(fem.calibrate(upright, START, PUBLISHED, ROUNDING)),
        "free constants": free_constants(fit.values),
        "lying flat": report(
            fem.calibrate(lying_flat, START, PUBLISHED, TOLERANCES, bounds=flat_bounds)
        ),
    }
    for name, text in blocks.items():
        print(f"\n{name}\n\n{text}")
    print(f"\n{time.perf_counter() - begin:.1f} s")
    if write:
        rounded = {name: round(value, 7) for name, value in fit.values.items()}
        write_dimensions(Dimensions(**rounded))
        make_meshes.main()
        text = DOCUMENT.read_text(encoding="utf-8")
        for name, content in blocks.items():
            text = with_block(text, name, content)
        DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
