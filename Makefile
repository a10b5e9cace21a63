# The two commands of the README: `make demo` and `make test`. Both prepare .venv by themselves.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.DEFAULT_GOAL := help
.PHONY: help demo test lint types check clean

help: ## what can be made
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; try: make $(MAKECMDGOALS) PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "Python's venv module is missing; on Debian: sudo apt-get install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: $(READY) ## fly, record and analyse a simulated Nexstar; the report lands in out/demo
	$(BIN)/sim tunnel -o out/demo/tunnel.csv
	$(BIN)/calibrate probe out/demo/tunnel.csv -o out/demo/probe.json
	$(BIN)/sim fly --aircraft nexstar --plan accel-decel --probe out/demo/probe.json -o out/demo
	$(BIN)/analyze out/demo/log.mcap -o out/demo/report

test: $(READY) ## the whole test suite
	$(BIN)/pytest -n auto --dist loadgroup

lint: $(READY) ## ruff
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY) ## mypy
	$(BIN)/mypy

check: lint types test ## lint, types, test

clean: ## remove what was made, except what was recorded in out/
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
