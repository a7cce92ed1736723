# `make paper` reproduces the paper's figures, `make atlas` follows all known branches of its larger
# models (hours; it goes on where it was interrupted), `make test` runs the tests, `make bench` measures
# speed against error, `make hard` computes the hard cases, `make faults` tries thousands of bad
# inputs and hundreds of kills, `make docs` builds the site of the documentation, `make slow` runs all
# tests that are too long for `make test`, `make sanitize` looks for faults of memory in the engine,
# `make wheels` builds what a release uploads, for all platforms.
# All set up a virtual environment in .venv first.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin

.PHONY: lock paper atlas test slow check bench hard faults sanitize wheels docs clean

# the versions are those of .ci/lock.txt, which `make lock` makes anew of the newest
$(VENV)/.installed: pyproject.toml .ci/lock.txt compile_engine.py $(wildcard nldyn/engine/*.[ch])
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--constraint .ci/lock.txt -e ".[dev]"
	@$(BIN)/python -c "from nldyn.engine.library import built_by; print('engine:', built_by())"
	touch $@

lock:
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --no-header \
		--no-annotate --no-emit-index-url --no-emit-find-links --extra dev \
		--output-file .ci/lock.txt pyproject.toml

paper: $(VENV)/.installed
	PYTHONPATH=tests $(BIN)/python -m paper --out results/paper

atlas: $(VENV)/.installed
	PYTHONPATH=tests $(BIN)/python -m paper --atlas --out results/atlas

# the workers share the cores: with two threads each, exponentials of 2 x 2 matrices took 200 times as
# long on a busy machine; the order of the files is that of tests/conftest.py
PYTEST = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed
	$(PYTEST)

slow: $(VENV)/.installed
	$(PYTEST) -m slow

check: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/.installed
	-$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[bench]"
	PYTHONPATH=tests $(BIN)/python -m bench --out results/bench

hard: $(VENV)/.installed
	PYTHONPATH=tests $(BIN)/python -m hard --out results/hard

# what no input and no machine may do to a run: docs/explanation/faults.md
faults: $(VENV)/.installed
	$(BIN)/python -m pytest tests/faults -m "slow or not slow" -o addopts=-q

# the engine with the sanitizers of addresses and of undefined behaviour: tests and random systems;
# that of addresses must find the library of C++ before others throw exceptions
SANITIZED = NLDYN_ENGINE=results/sanitized OPENBLAS_NUM_THREADS=1 ASAN_OPTIONS=detect_leaks=0 \
	LD_PRELOAD="$(foreach library,libasan.so libstdc++.so.6,$(shell $(CC) -print-file-name=$(library)))" \
	$(BIN)/python
sanitize: $(VENV)/.installed
	NLDYN_ENGINE=results/sanitized $(BIN)/python compile_engine.py -O1 -g \
		-fsanitize=address,undefined -fno-sanitize-recover=undefined
	$(SANITIZED) tests/random_systems.py 10000
	$(SANITIZED) -m pytest tests/nldyn/flow tests/nldyn/orbits tests/nldyn/longterm

# from the source archive, so that this holds all they need
wheels: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[release]"
	rm -rf dist
	$(BIN)/python -m build --sdist --outdir dist
	for platform in $$($(BIN)/python -c "import compile_engine; print(*compile_engine.TARGETS)"); do \
		NLDYN_PLATFORM=$$platform $(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation \
			--wheel-dir dist dist/*.tar.gz || exit 1; done
	$(BIN)/python -m twine check --strict dist/*
	$(BIN)/check-wheel-contents dist/*.whl
	$(BIN)/python tests/wheels.py dist

# a broken link or a public name without a docstring ends the build
docs: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[docs]"
	$(BIN)/python -m sphinx -q -E -W --keep-going -j auto -b html docs results/site
	@echo "open results/site/index.html"

clean:
	rm -rf results $(VENV)
