"""The page of a convergence study in a real browser: hover, another view, sort, no error."""

from dataclasses import replace

import pytest
from browser import opened, skip_without_browser, until
from problems import SETTING, string

from nldyn import convergence_study
from nldyn.reduction.model_errors import largest_force
from nldyn.report.convergence import write_study

skip_without_browser()

PANELS = """
return [...document.querySelectorAll("#plots .plot")].map((plot) =>
  [plot.layout.yaxis.title.text, plot.data.map((trace) => trace.y), plot.layout.shapes.length]);
"""
AT = """
const plot = document.querySelectorAll("#plots .plot")[arguments[0]], full = plot._fullLayout;
plot.scrollIntoView({ block: "center" });
const box = plot.getBoundingClientRect(), trace = plot.data[0];
return [box.left + full.xaxis._offset + full.xaxis.l2p(trace.x[0]),
        box.top + full.yaxis._offset + full.yaxis.l2p(trace.y[0])];
"""
HOVERED = """
return [...document.querySelectorAll("#plots .hoverlayer text")].map((t) => t.textContent).join();
"""
COLUMN = """
return [...document.querySelectorAll("#table tbody tr")].map((row) =>
  Number(row.children[2].textContent));
"""


@pytest.fixture(scope="module")
def study():
    other = replace(string(), stiffness=1.02 * string().stiffness)
    return convergence_study({"a": string(), "b": other}, SETTING, modes=(1, 3), at=36.0)


@pytest.fixture(scope="module")
def browser(study, tmp_path_factory):
    place = tmp_path_factory.mktemp("study")
    folder = place / "out"
    folder.mkdir()
    write_study(study, folder, "A <string>")
    with opened(folder / "convergence.html", place) as browser:
        yield browser


def test_the_panels_show_the_numbers_of_the_study(browser, study):
    shown = {name: (lines, shapes) for name, lines, shapes in browser.execute_script(PANELS)}
    lines, shapes = shown["contact force (N)"]
    assert lines == [
        [pytest.approx(largest_force(study.models[i].orbit)) for i in indices]
        for indices in study.series().values()
    ]
    assert shapes == 3  # within 1 %, the reference, the error band
    assert {"eigenfrequencies (Hz)", "peak height (mm)", "contact duration (ms)"} < set(shown)


def test_hover_names_the_model_and_how_far_it_is_off(browser):
    from selenium.webdriver.common.action_chains import ActionChains

    chain = ActionChains(browser, duration=0)
    at = browser.execute_script(AT, 3)
    chain.w3c_actions.pointer_action.move_to_location(*map(round, at))
    chain.perform()
    until(lambda: "off the reference" in browser.execute_script(HOVERED))
    assert "a rubin, 1 mode" in browser.execute_script(HOVERED)


def test_meshes_are_shown_by_their_size(browser):
    (button,) = [
        each
        for each in browser.find_elements("css selector", "#views button")
        if each.text == "over degrees of freedom"
    ]
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    assert len(browser.execute_script(PANELS)[1][1]) == 2  # one line for each count


def test_the_table_is_sorted(browser):
    head = browser.find_elements("css selector", "#table thead th")[2]
    head.click()
    head.click()
    assert head.get_attribute("aria-sort") == "descending"
    cells = browser.execute_script(COLUMN)
    assert len(cells) == 5 and cells == sorted(cells, reverse=True)
