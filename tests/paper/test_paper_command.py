"""``python -m paper``: what it hands on, and what it says when it is stopped."""

import pytest

import paper
from paper.__main__ import main
from paper.kept import kept_folder, write_numbers


def test_options_are_handed_on(tmp_path, monkeypatch, capsys):
    given = []

    def take(out, jobs, quiet):
        given.append((out, jobs, quiet))

    monkeypatch.setattr(paper, "compute_paper", take)
    monkeypatch.setattr(paper, "compute_atlas", take)
    main(["--out", str(tmp_path)])
    main(["--atlas", "--out", str(tmp_path), "--jobs", "3", "--quiet"])
    assert given == [(tmp_path, 2, False), (tmp_path, 3, True)]
    with pytest.raises(SystemExit) as end:
        main(["--out", str(tmp_path), "--jobs", "0"])
    assert end.value.code == 2
    assert "--jobs must be at least 1, got 0" in capsys.readouterr().err


def test_ctrl_c_names_what_is_kept(tmp_path, monkeypatch, capsys):
    def interrupted_after_a_while(out, jobs, quiet):
        write_numbers(kept_folder(out) / "one.json", 1)
        raise KeyboardInterrupt

    monkeypatch.setattr(paper, "compute_paper", interrupted_after_a_while)
    with pytest.raises(SystemExit) as end:
        main(["--out", str(tmp_path / "paper")])
    assert end.value.code == 130
    assert f"{tmp_path / 'paper.unfinished'} keeps what was computed" in capsys.readouterr().err


def test_bad_place_is_told_in_one_line(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(SystemExit) as end:
        main(["--out", str(tmp_path)])
    assert end.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
