# `make take-off` runs the main job and `make test` the tests; both set up what they need in .venv first.
PYTHON ?= python3
BIN := .venv/bin
RESULTS := results/take-off

.PHONY: help setup take-off test lint docs clean

help:
	@echo "make take-off   set up, solve the take-off, write $(RESULTS)/{trajectory.npz,forces.png,replay.html}"
	@echo "make test       set up, check the style and run the tests"
	@echo "make lint       ruff and mypy --strict"
	@echo "make docs       set up, build the documentation in site/"
	@echo "make clean      remove the environment, the results and the built documentation"

setup: .venv/ready

take-off: .venv/ready
	$(BIN)/multimodal-to solve take-off --output $(RESULTS)

test: .venv/ready-dev lint
	$(BIN)/python -m pytest

lint: .venv/ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: .venv/ready-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "open site/index.html"

clean:
	rm -rf .venv results site

.venv/ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; run: make $(MAKECMDGOALS) PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

# --group needs pip 25.1, so pip comes first
.venv/ready-dev: .venv/ready
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --group dev
	touch $@

.venv/ready-docs: .venv/ready
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --group docs
	touch $@
