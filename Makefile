# Each target sets up its own environment first. A new machine needs Python 3.11 or later, pip and make.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo test test-all test-fast test-light test-lowest coverage coverage-all lint format types docs check clean

demo: $(VENV)/.installed
	$(BIN)/windwrench demo --out results/demo

# processes that share the tests; 0: none beside the first
WORKERS ?= auto
# one thread of linear algebra for each worker, or they wait for one another
PYTEST = OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --max-worker-restart 0
COVERAGE = --cov --cov-report=term-missing:skip-covered --cov-fail-under=88
# folders that neither diagnose, train, draw, nor start programs
FAST = tests/core tests/controllers tests/dynamics tests/estimator tests/identification/logs tests/identification/motion \
	tests/runtime tests/evaluation/test_statistics.py tests/project/test_structure.py

CORE = $(shell find core live/export_c/source -name '*.[ch]pp')

# all but the marked slow: some 5 minutes on two cores, and nearly all lines
test: $(VENV)/.tested
	$(PYTEST) -m "not slow"

test-all: $(VENV)/.tested
	$(PYTEST)

test-fast: $(VENV)/.tested
	$(PYTEST) -m "not slow" $(FAST)

# the quick tests where nothing is installed that learns: what other Pythons are tried with
test-light: $(VENV)/.light
	$(PYTEST) -m "not slow" $(FAST)

# the same with the lowest versions that pyproject.toml allows
test-lowest: $(VENV)-lowest/.lowest
	$(subst $(BIN),$(VENV)-lowest/bin,$(PYTEST)) -m "not slow" $(FAST)

# programs that tests start write beside the others, wherever they run
coverage: $(VENV)/.tested
	COVERAGE_FILE=$(CURDIR)/.coverage $(PYTEST) -m "not slow" $(COVERAGE)

coverage-all: $(VENV)/.tested
	COVERAGE_FILE=$(CURDIR)/.coverage $(PYTEST) $(COVERAGE)

lint: $(VENV)/.tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/clang-format --dry-run --Werror $(CORE)
	$(BIN)/python .ci/counters.py

format: $(VENV)/.tested
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(CORE)

# the package as a user has it, outside the checkout
.PHONY: $(VENV)/built
$(VENV)/built: $(VENV)/.tested
	rm -rf $@
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --target $@ .

# evidence and reproduction, which no wheel holds, beside the package
types: $(VENV)/built
	cp -r evidence reproduction $(VENV)/built/windwrench/
	cd installation && MYPYPATH=. $(abspath $(BIN))/mypy --explicit-package-bases --config-file $(CURDIR)/pyproject.toml *.py
	cd $(VENV)/built && MYPYPATH=. $(abspath $(BIN))/mypy --config-file $(CURDIR)/pyproject.toml -p windwrench

# from a copy, with the page that the commands make
docs: $(VENV)/built
	rm -rf $(VENV)/pages site
	mkdir $(VENV)/pages
	cp -r docs mkdocs.yml $(VENV)/pages
	$(BIN)/python .ci/commands_page.py > $(VENV)/pages/docs/commands.md
	cd $(VENV)/pages && WINDWRENCH_BUILT=$(abspath $(VENV)/built) $(abspath $(BIN))/zensical build
	mv $(VENV)/pages/site site

check: lint types docs test

$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --disable-pip-version-check -c constraints.txt -e .
	touch $@

# torch first and by itself: a looser requirement could bring in a build with several gigabytes of CUDA
$(VENV)/.tested: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt torch
	WINDWRENCH_CORE=all $(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

$(VENV)/.light: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	WINDWRENCH_CORE=all $(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	touch $@

$(VENV)-lowest/.lowest: pyproject.toml .ci/lowest.py
	$(PYTHON) -m venv $(@D)
	$(PYTHON) .ci/lowest.py > $(@D)/lowest.txt
	WINDWRENCH_CORE=all $(@D)/bin/pip install --quiet --disable-pip-version-check -c $(@D)/lowest.txt -e '.[test]'
	touch $@

# the version in its four places: make version VERSION=2.0.0
.PHONY: version
version:
	sed -i 's|^__version__ = .*|__version__ = "$(VERSION)"|' __init__.py
	sed -i 's|^version: .*|version: $(VERSION)|' CITATION.cff
	sed -i 's|version = {[0-9.]*}|version = {$(VERSION)}|' README.md
	sed -i "s|^## \[Unreleased\]|&\n\n## [$(VERSION)] - $$(date +%F)|" CHANGELOG.md

# README with the repository's address: make address ADDRESS=https://...
.PHONY: address
address:
	sed -i 's|ADDRESS-OF-THIS-REPOSITORY|$(ADDRESS)|' README.md

# one line on each log of FOLDER: read, or refused and why
foreign: $(VENV)/.tested
	@find $(FOLDER) -type f | sort | while read -r log; do \
	  if said=$$($(BIN)/windwrench check "$$log" 2>&1); then echo "$$log: read"; \
	  else echo "$$said" | tail -1; fi; \
	done

clean:
	rm -rf $(VENV) $(VENV)-* build dist results site *.egg-info _core/*.so _core/built.*
