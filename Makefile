# `make take-off` runs the main job and `make test` the tests; both set up what they need in .venv first.
PYTHON ?= python3
BIN := .venv/bin
RESULTS := results/take-off
INSTALL := $(BIN)/python -m pip install --quiet --constraint constraints.txt
# One process of the tests for each core. More than four need much memory and wait for the longest tests.
WORKERS := --numprocesses logical --maxprocesses 4 --dist worksteal
# What the native library is compiled from; it is compiled when the package is installed.
NATIVE := $(wildcard src/multimodal_to/native/sources/*.[ch]) src/multimodal_to/native/compiling.py
OLDEST := .venv-oldest
# The core: what depends on casadi and numpy. Peers are left out, their own oldest versions are not ours to test.
OLDEST_TESTS := tests/adam/test_adam_physics.py tests/adam/test_adam_urdf.py tests/test_properties.py \
	tests/models tests/ocp tests/auditing tests/solving/test_take_off.py

.PHONY: help setup take-off test test-oldest lint docs constraints clean

help:
	@echo "make take-off     set up, solve the take-off, write $(RESULTS)/{trajectory.npz,forces.png,replay.html}"
	@echo "make test         set up, check the style and run the tests"
	@echo "make test-oldest  run the core's tests with the oldest allowed versions, see oldest.txt"
	@echo "make lint         ruff and mypy --strict"
	@echo "make docs         set up, build the documentation in site/"
	@echo "make constraints  write constraints.txt anew with the newest versions"
	@echo "make clean        remove the environments, the results and the built documentation"

setup: .venv/ready

take-off: .venv/ready
	$(BIN)/multimodal-to solve take-off --output $(RESULTS)

test: .venv/ready-dev lint
	$(BIN)/python -m pytest $(WORKERS)

test-oldest: $(OLDEST)/ready
	$(OLDEST)/bin/python -m pytest $(WORKERS) $(OLDEST_TESTS)

lint: .venv/ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: .venv/ready-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "open site/index.html"

clean:
	rm -rf .venv .venv-oldest .venv-constraints results site

.venv/ready: pyproject.toml constraints.txt hatch_build.py $(NATIVE)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; run: make $(MAKECMDGOALS) PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv .venv
	$(INSTALL) --editable .
	touch $@

# --group needs pip 25.1, so pip comes first
.venv/ready-dev: .venv/ready
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(INSTALL) --group dev
	touch $@

.venv/ready-docs: .venv/ready
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(INSTALL) --group docs
	touch $@

$(OLDEST)/ready: pyproject.toml oldest.txt hatch_build.py $(NATIVE)
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	$(OLDEST)/bin/python -m pip install --quiet --constraint oldest.txt --editable . --group core
	touch $@

constraints:
	rm -rf .venv-constraints
	$(PYTHON) -m venv .venv-constraints
	.venv-constraints/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	.venv-constraints/bin/python -m pip install --quiet --editable '.[ray,rerun,table]' --group dev --group docs
	{ echo "# The tested versions: names and versions that every install of the Makefile uses."; \
	  echo "# Written by make constraints with $$(.venv-constraints/bin/python --version)."; \
	  .venv-constraints/bin/python -m pip list --format=freeze --exclude-editable --exclude pip --exclude setuptools; \
	} > .venv-constraints/constraints.txt
	mv .venv-constraints/constraints.txt constraints.txt
	rm -rf .venv-constraints
	@echo "wrote constraints.txt; now run make test and make docs, and commit it"
