# `make paper` reproduces the paper's figures, `make test` runs the tests, `make bench` measures
# speed against error, `make hard` computes the hard cases. All set up a virtual environment in
# .venv first.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin

.PHONY: paper test check bench hard clean

$(VENV)/.installed: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $@

paper: $(VENV)/.installed
	$(BIN)/nldyn paper --out results/paper

test: $(VENV)/.installed
	$(BIN)/python -m pytest

check: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/.installed
	-$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[bench]"
	$(BIN)/python -m nldyn.bench --out results/bench

hard: $(VENV)/.installed
	$(BIN)/python -m nldyn.hard --out results/hard

clean:
	rm -rf results $(VENV)
