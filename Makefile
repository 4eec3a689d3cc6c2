# Needs only make and Python 3.11 or newer. Everything is installed into .venv.

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# Tests run side by side: processes, for the two cores that are asked for. One more than cores, as tests of whole runs wait.
JOBS ?= 3
# Which part of what takes long is tested: a number, or all.
TURN ?= 0
TEST_STAMP := $(VENV)/.test-installed
LINT_STAMP := $(VENV)/.lint-installed
DOCS_STAMP := $(VENV)/.docs-installed
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: help install table1 test test-all fuzz lint docs format lock clean
.DEFAULT_GOAL := help

help:
	@echo "make install  set everything up in .venv; the command is .venv/bin/shadowbench"
	@echo "make table1   set everything up, run Table 1 on what this machine has, print it, draw the pictures"
	@echo "make test     set everything up, run the tests; what takes long takes turns, TURN=1, 2, ... (JOBS=9 where there are eight cores)"
	@echo "make test-all every test, and every exact method on every hard case"
	@echo "make fuzz     hard cases in other places, a second judge, sequences of frames, then random scenes: an hour or more"
	@echo "make lint     ruff and mypy"
	@echo "make docs     the documentation as a site: build/site/index.html"
	@echo "make format   let ruff put the code in shape"
	@echo "make lock     write the lists of packages with their hashes anew, after a change of pyproject.toml or constraints.txt"
	@echo "make clean    remove .venv and caches (results stay)"

install: $(STAMP)
	@echo "installed: $(BIN)/shadowbench --help"

table1: $(STAMP)
	$(BIN)/shadowbench run table1 $(ARGS)

test: $(TEST_STAMP)
	SHADOWBENCH_TURN=$(TURN) $(BIN)/python -m pytest -n $(JOBS) --dist worksteal $(ARGS)

test-all: TURN := all
test-all: test

fuzz: $(TEST_STAMP)
	SHADOWBENCH_SWEEP=all $(BIN)/python -m pytest -n $(JOBS) tests/properties \
		tests/hardcases/test_hard_cases.py tests/emulated
	$(BIN)/python tests/tools/second_opinion.py --rays 100000
	$(BIN)/python tests/tools/play.py --frames 10000
	$(BIN)/python tests/tools/play.py --frames 5000 --effects
	$(BIN)/python tests/tools/fuzz.py --examples 100000 $(ARGS)
	$(BIN)/python tests/tools/fuzz_inputs.py --cases 40000

lint: $(LINT_STAMP) build/lint/shadowbench
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	cd build/lint && ../../$(BIN)/mypy --config-file ../../pyproject.toml -p shadowbench

docs: $(DOCS_STAMP) build/lint/shadowbench
	rm -rf build/docs && mkdir -p build/docs
	ln -s $(addprefix ../../,docs results LICENSE $(wildcard *.md)) build/docs/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@! grep -rlE '(src|<link [^>]*href)="(https?:)?//' build/site --include='*.html' || { echo "make: these pages fetch something" >&2; exit 1; }

format: $(LINT_STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) build .mypy_cache .ruff_cache .pytest_cache .hypothesis *.egg-info

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed; name it with make PYTHON=/path/to/python3" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# Versions and hashes of all packages are in requirements.txt and .ci/requirements-*.txt, which `make lock` makes; what is
# installed is what was tested, byte for byte. Installed anew only where the lists change.
define install
$(PIP) install --no-deps --require-hashes -r $(1) || { echo "make: the packages of $(1) could not be installed, as is said above; \
	where it says Retrying or No matching distribution, the package index cannot be reached. The same command goes on." >&2; exit 1; }
endef

$(STAMP): pyproject.toml setup.py requirements.txt | $(BIN)/python
	@echo "Installing into $(VENV) (once, about half a minute)"
	@$(PIP) uninstall --yes shadowbench >/dev/null 2>&1 || true  # the former name of the distribution
	@$(call install,requirements.txt)
	$(PIP) install --no-deps --no-build-isolation -e .
	@touch $@

$(TEST_STAMP) $(LINT_STAMP) $(DOCS_STAMP): $(VENV)/.%-installed: .ci/requirements-%.txt $(STAMP)
	@$(call install,$<)
	@touch $@

lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check 'uv>=0.9'
	PATH="$(CURDIR)/build/lock/bin:$$PATH" $(PYTHON) .ci/lock.py

# mypy does not follow setuptools' package-dir, so it is shown the folders under their import names.
build/lint/shadowbench: Makefile
	mkdir -p $@
	ln -sfn ../../../harness ../../../methods ../../../experiments ../../../harness/shadowbench/__init__.py $@/
	ln -sfn ../../../harness/shadowbench/__main__.py $@/
