"""The report in a real browser: hover, click, zoom, sort, download, and no error on the console."""

import csv

import numpy as np
import pytest
from browser import opened, skip_without_browser, until

from nldyn.base.resources import example
from nldyn.report.again import drawn_of
from nldyn.report.results import write_results
from nldyn.scene.read import parse_scene
from nldyn.scene.run import compute, structure_of

skip_without_browser()

AT = """
const plot = document.getElementById("diagram"), full = plot._fullLayout;
const box = plot.getBoundingClientRect();
return [box.left + full.xaxis._offset + full.xaxis.l2p(arguments[0]),
        box.top + full.yaxis._offset + full.yaxis.l2p(arguments[1])];
"""
# clicks of a test may follow one another so quickly that Plotly takes the second for a double click
SINGLE = "document.getElementById('diagram')._context.doubleClickDelay = 0"
MARKS = """
return document.getElementById("diagram").data.flatMap((trace) =>
  (trace.customdata || []).map((place, i) => [...place, trace.x[i], trace.y[i]]));
"""

HOVERED = """
return [...document.querySelectorAll("#diagram .hoverlayer text")].map((t) =>
  t.querySelector(".line") ? [...t.querySelectorAll(".line")].map((l) => l.textContent).join(" ")
    : t.textContent).join(" ").trim();
"""
CURVES = """
return ["history", "force", "portrait", "spectrum", "circle"].map((name) =>
  document.getElementById(name).data[0].x.length);
"""
COLUMN = """
return [...document.querySelectorAll("#table tbody tr")].map((row) =>
  Number(row.children[arguments[0]].textContent));
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of the two-DOF beam around its resonance."""
    file = example("two_dof_xi_0.01.toml")
    text = file.read_text().replace("range_hz = [15.0, 90.0]", "range_hz = [22.8, 23.6]")
    text = text.replace(
        "periods = [1, 2, 3]", "periods = [1]\nsearch_points = 1\nfollow_doublings = 0"
    )
    scene = parse_scene(text, file)
    structure = structure_of(scene)
    place = tmp_path_factory.mktemp("browser")
    found = compute(scene, structure=structure)
    return write_results(found, place / "out", scene, drawn=drawn_of(scene, structure))


@pytest.fixture(scope="module")
def browser(folder, tmp_path_factory):
    with opened(folder / "report.html", tmp_path_factory.mktemp("downloads")) as browser:
        browser.downloads = tmp_path_factory.getbasetemp()
        browser.execute_script(SINGLE)
        yield browser


def text_of(browser, name):
    return browser.execute_script(f"return document.getElementById('{name}').textContent")


def pointer(browser, x, y):
    from selenium.webdriver.common.action_chains import ActionChains

    browser.execute_script("window.scrollTo(0, 0)")
    at = browser.execute_script(AT, x, y)
    chain = ActionChains(browser, duration=0)
    chain.w3c_actions.pointer_action.move_to_location(*map(round, at))
    return chain


def test_click_on_a_special_point_shows_its_very_orbit(browser, folder):
    with (folder / "special_points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    marks = [mark for mark in browser.execute_script(MARKS) if mark[0] == "special"]
    assert len(marks) == len(rows)
    places = np.array([browser.execute_script(AT, x, y) for *_, x, y in marks])
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + 1e3 * np.eye(len(places))
    alone = [mark for mark, nearest in zip(marks, apart.min(axis=1), strict=True) if nearest > 15]
    assert alone
    for *_, x, y in alone:
        pointer(browser, x, y).click().perform()
        until(lambda x=x: f"at {x:.7g} Hz" in text_of(browser, "which"))
        assert text_of(browser, "said") == ""


def find(browser, css):
    return browser.find_element("css selector", css)


def test_hover_tells_what_a_special_point_means(browser, folder):
    with (folder / "special_points.csv").open(newline="") as file:
        meaning = {row["meaning"] for row in csv.DictReader(file)}
    *_, x, y = next(mark for mark in browser.execute_script(MARKS) if mark[0] == "special")
    pointer(browser, x, y).perform()
    until(lambda: browser.execute_script(HOVERED))
    said = browser.execute_script(HOVERED).replace("  ", " ")
    assert any(sentence[:60] in said for sentence in meaning), said


def test_click_shows_the_orbit_or_the_nearest_one(browser):
    points = [mark for mark in browser.execute_script(MARKS) if mark[0] == "point"]
    *_, x, y = points[len(points) // 2]
    pointer(browser, x, y).click().perform()
    until(lambda: " Hz (" in text_of(browser, "which"))
    assert all(count > 2 for count in browser.execute_script(CURVES))
    told = text_of(browser, "said")
    assert told == "" or "is not in this page; this is the nearest" in told


def test_drag_enlarges_and_double_click_brings_the_whole_back(browser):
    span = "return document.getElementById('diagram')._fullLayout.xaxis.range"
    before = browser.execute_script(span)
    low, high = browser.execute_script(
        "return document.getElementById('diagram')._fullLayout.yaxis.range"
    )
    chain = pointer(browser, 23.0, low + 0.3 * (high - low)).click_and_hold()
    chain.w3c_actions.pointer_action.move_by(200, -120)
    chain.release().perform()
    until(lambda: browser.execute_script(span) != before)
    left, right = browser.execute_script(span)
    assert right - left < 0.6 * (before[1] - before[0])
    browser.execute_script("Plotly.relayout('diagram', {'xaxis.range': arguments[0]})", before)


def test_the_structure_is_deflected_and_goes_through_its_period(browser):
    slider, said = ".viewer-instant", ".viewer-said"
    first = find(browser, said).text
    assert "deflection drawn ×" in first and "red: the stop" in first
    picture = "return viewer.drawNow(), viewer.canvas.toDataURL()"
    browser.execute_script("window.viewer = viewerOfPage")
    deepest = browser.execute_script(picture)
    browser.execute_script(
        "const slider = document.querySelector(arguments[0]); slider.value = (Number(slider.value)"
        " + 0.5) % 1; slider.dispatchEvent(new Event('input'))", slider,
    )  # fmt: skip
    assert browser.execute_script(picture) != deepest
    until(lambda: find(browser, said).text != first)


def test_tables_are_sorted_and_downloaded(browser, folder):
    find(browser, "[data-tab='points']").click()
    heads = browser.find_elements("css selector", "#table thead th")
    (column,) = [i for i, head in enumerate(heads) if head.text.startswith("max abs displacement")]
    for order in ("ascending", "descending"):
        heads[column].click()
        assert heads[column].get_attribute("aria-sort") == order
    cells = browser.execute_script(COLUMN, column)
    assert len(cells) > 5 and cells == sorted(cells, reverse=True)
    find(browser, "#table [data-csv='points']").click()
    until(lambda: any(browser.downloads.rglob("points.csv")))
    (saved,) = browser.downloads.rglob("points.csv")
    with saved.open(newline="") as file:
        taken = {row["frequency_hz"] for row in csv.DictReader(file)}
    with (folder / "branches.csv").open(newline="") as file:
        computed = {row["frequency_hz"] for row in csv.DictReader(file)}
    assert {float(hz) for hz in taken} == {float(hz) for hz in computed}
