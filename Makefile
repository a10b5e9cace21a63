# The two commands of the README: `make demo` and `make test`. Both create .venv if needed.

# The system's Python first: one that was compiled without optimization, as by pyenv, takes 1.25 times as long.
PYTHON ?= $(shell for python in /usr/bin/python3.11 python3.11 /usr/bin/python3 python3; do \
	"$$python" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && break; \
	done; echo "$$python")
VENV := .venv
BIN := $(VENV)/bin
JOBS ?= 2
ARCHITECTURE ?= $(shell dpkg --print-architecture 2>/dev/null)
# .ready: what the demonstration needs is installed; .dev: tests and tools are, too.
READY := $(VENV)/.ready
INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable
# The matrices here are small: a pool of threads in every test process costs more than it gives.
export OPENBLAS_NUM_THREADS := 1
# Each process would compile the tests and our code again.
unexport PYTHONDONTWRITEBYTECODE
# Some tests mount file systems. Without root they run in a user namespace, or are skipped where there is none.
IN_NAMESPACE = $(shell [ "$$(id -u)" = 0 ] || { unshare -Urm true 2>/dev/null && echo unshare -Urm; })

# One process more than processors: some tests wait for daemons that record in real time.
WORKERS := $(shell expr $$(getconf _NPROCESSORS_ONLN) + 1)

.DEFAULT_GOAL := help
.PHONY: help demo picture test test-all near bench site evidence study dissertation soak fuzz crash-points vm packages deb lint types check constraints clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; try: make $(MAKECMDGOALS) PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "Python's venv module is missing; on Debian: sudo apt-get install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@echo "Installing into $(VENV): a minute, 500 MB"
	@$(INSTALL) '.[analysis,sim]'
	@$(BIN)/python benchmarks/environment.py
	@touch $@

$(VENV)/.dev: $(READY)
	@echo "Installing the tools of development into $(VENV)"
	@$(INSTALL) '.[dev]'
	@$(BIN)/python benchmarks/environment.py
	@touch $@

$(VENV)/.docs: $(READY)
	$(INSTALL) '.[docs]'
	@touch $@

site: $(VENV)/.docs ## the documentation as a site in build/site; a broken link is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

demo: $(READY) ## fly, record and analyze a simulated Nexstar; the report lands in out/demo
	$(BIN)/sim fly --replace --plan demo -o out/demo
	$(BIN)/analyze out/demo/log.mcap

picture: demo $(VENV)/.dev ## renew the pictures of README and pages: curve, report, card, route, by Chromium
	PYTHONPATH=. $(BIN)/python benchmarks/page_pictures.py out/demo docs

test: $(VENV)/.dev ## every claim by one seed or flight, for daily work
	$(IN_NAMESPACE) $(BIN)/pytest -n $(WORKERS) --dist loadgroup

test-all: $(VENV)/.dev ## the whole test suite: all seeds, flights and worlds
	$(IN_NAMESPACE) $(BIN)/pytest -n $(WORKERS) --dist loadgroup --all

near: $(VENV)/.dev ## the five test files nearest to a file, by imports: make near FILE=analysis/curve.py
	@tests=$$($(BIN)/python -m tests.near $(FILE)) && $(BIN)/pytest $$tests

bench: $(VENV)/.dev ## measure drivers, simulator, parameter estimation and daemon
	$(IN_NAMESPACE) $(BIN)/python benchmarks/bench.py
	$(BIN)/python benchmarks/bench.py analysis --with before=HEAD~1
	$(BIN)/python benchmarks/estimation.py statistics
	$(BIN)/python benchmarks/estimation.py significance
	$(BIN)/python benchmarks/estimation_cases.py filter
	$(BIN)/python benchmarks/estimation_cases.py optima
	$(BIN)/python benchmarks/estimation_cases.py cases
	$(BIN)/python benchmarks/estimation_cases.py agreement
	$(BIN)/python benchmarks/daemon.py faults
	$(BIN)/python benchmarks/daemon.py mend
	$(BIN)/python benchmarks/daemon.py day

evidence: $(VENV)/.dev ## every figure of README and docs/evidence from this version, into docs/evidence (about 90 minutes)
	$(IN_NAMESPACE) $(BIN)/python benchmarks/evidence.py --jobs $(JOBS)

study: $(VENV)/.dev ## coverage over worlds, weather and plans; hours, goes on where it stopped; JOBS=4 for four processes
	$(BIN)/python benchmarks/worlds.py --jobs $(JOBS)

dissertation: $(VENV)/.dev ## the results of the dissertation's chapters 4 and 7 from simulated flights, into out/dissertation (4 min)
	$(BIN)/python benchmarks/dissertation.py

soak: $(VENV)/.dev ## the daemon for ten minutes in real time at 25 and at 100 Hz, on device files (needs root)
	$(BIN)/python benchmarks/daemon.py soak --fifo --rate 25
	$(BIN)/python benchmarks/daemon.py soak --fifo --rate 100

fuzz: $(VENV)/.dev ## a million inputs into every parser of bytes from outside (half an hour)
	$(INSTALL) '.[fuzz]'
	$(BIN)/python benchmarks/fuzz.py run

crash-points: $(VENV)/.dev ## cut the daemon's power at 500 writes of each of three recordings (needs root; 15 min)
	for seed in 1003 1004 1005; do $(BIN)/python benchmarks/crash_points.py --points 500 --seed $$seed || exit; done

packages: $(VENV)/.dev ## build sdist and wheel, and try the wheel beside its neighbors on Python 3.11 to 3.14 (5 min for each)
	$(BIN)/python benchmarks/packages.py

.PHONY: deb-needs
deb-needs:
	@$(PYTHON) debian/build.py --architecture $(ARCHITECTURE) --needs

deb: deb-needs $(READY) ## the recorder as a Debian package in dist; ARCHITECTURE=arm64 for a Raspberry Pi (3 min)
	$(BIN)/python debian/build.py --architecture $(ARCHITECTURE)

vm: $(VENV)/.dev ## the service in a virtual Debian computer: installed, power pulled, unplugged, upgraded (needs root; 1 h)
	$(BIN)/python benchmarks/vm

lint: $(VENV)/.dev ## ruff, and American spelling
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell

types: $(VENV)/.dev ## mypy
	$(BIN)/mypy

check: lint types test-all ## lint, types, test-all

constraints: ## renew constraints.txt: the newest versions that pyproject.toml allows, then run `make check`
	rm -rf build/constraints && $(PYTHON) -m venv build/constraints
	build/constraints/bin/pip install --quiet --disable-pip-version-check --editable '.[dev,docs]'
	sed -n '/^#/p' constraints.txt > build/constraints.txt
	build/constraints/bin/pip freeze --exclude-editable --exclude pip --exclude setuptools >> build/constraints.txt
	mv build/constraints.txt constraints.txt && rm -rf build/constraints

clean: ## remove generated files, except recordings in out/
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
