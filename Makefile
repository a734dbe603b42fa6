# Each target sets up its own environment first. A new machine needs Python 3.11 or later, pip and make.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo test coverage lint types check clean

demo: $(VENV)/.installed
	$(BIN)/windwrench benchmark --episodes 10 --out results/demo
	$(BIN)/windwrench fly --scenario static --out results/demo

test: $(VENV)/.tested
	$(BIN)/python -m pytest -n auto --dist loadfile

# compiled code is run, but not seen; `@compiled` functions are left out of the count
coverage: $(VENV)/.tested
	$(BIN)/python -m pytest -n auto --dist loadfile --cov --cov-report=term-missing:skip-covered --cov-fail-under=90

lint: $(VENV)/.tested
	$(BIN)/ruff check .

# as a user's type checker sees it: the built package, from outside the checkout
types: $(VENV)/.tested
	rm -rf $(VENV)/built
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --target $(VENV)/built .
	cd $(VENV)/built && MYPYPATH=. $(abspath $(BIN))/mypy --config-file $(CURDIR)/pyproject.toml -p windwrench

check: lint types test

$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

# torch first and by itself: a looser requirement could bring in a build with several gigabytes of CUDA
$(VENV)/.tested: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt torch
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist results *.egg-info
	find . -name '*.nb[ic]' -delete
