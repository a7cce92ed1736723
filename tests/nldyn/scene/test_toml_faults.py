"""What is likely missing in a text that is not TOML."""

import pytest

from nldyn.base.errors import SceneError
from nldyn.scene.read import parse_scene


@pytest.mark.parametrize(
    ("text", "guess"),
    [
        ("[modal\n", "in '[modal' ']' is likely missing"),
        ("[[stops]\n", "in '[[stops]' ']]' is likely missing"),
        ("[modal]\nf = [1.0,\n  2.0\n[damping]", "in 'f = [1.0,' ']' is likely missing at the end"),
        ("[modal]\nf = [1.0 2.0]", "in 'f = [1.0 2.0]' ']' is likely missing at the end of the li"),
        ("[[stops]]\nat = tip # here", "in 'at = tip # here' quotes are likely missing: \"tip\""),
        ("[[stops]]\nat =\n", "in 'at =' the value is missing"),
        ('title = "foo\n', "in 'title = \"foo' a quotation mark is likely missing"),
        ("x [1.0]", "in 'x [1.0]' '=' is likely missing"),
        ("x: 1.0", "in 'x: 1.0' ':' stands in place of '='"),
        ("x = 0,01", "a comma stands in place of a decimal point"),
        ("x = .01", "a digit is missing before the decimal point"),
        ("x = 1.e-2", "a digit is missing behind the decimal point"),
        ("x = True", "true or false is likely meant, in small letters"),
        ('file = "C:\\meshes"', "write / in its place"),
        ('file = "C:\\users\\mesh.msh"', "write / in its place"),
        ("gap = 0.2 mm", "a number stands without its unit"),
        ("gap = 0.2mm", "a number stands without its unit"),
        ("[modal] x = 1.0", "a new line is missing behind the name of the table"),
    ],
)
def test_bad_toml_says_what_is_likely_missing(text, guess):
    with pytest.raises(SceneError) as fault:
        parse_scene(text)
    assert "is not valid TOML: " in str(fault.value) and guess in str(fault.value)
