# What the continuous integration runs, by name. `make test` is all of it but the built wheel (see .ci/run).
VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= $(shell python3.11 -c 'print("python3.11")' 2>/dev/null || echo python3)
CODE := $(wildcard conftest.py src tests examples benchmarks docs)
# Two processes, whole files: tests of one file share their compiled functions. They stay in the order of conftest.py. A
# process that crashes ends the run.
PYTEST_ARGS ?= -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

.DEFAULT_GOAL := help
.PHONY: help setup demo test lint docs format fast-test slow-test coverage lock clean

help: ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | expand -t 12

setup: $(VENV)/.complete ## Make .venv with everything of requirements.lock and this package, editable

# The stamp is written last, so that an interrupted set-up starts again.
$(VENV)/.complete: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo 'Python must be 3.11 or newer; name one: make setup PYTHON=python3.12' >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

demo: setup ## Train task 2 (the pendulum), compare its errors with the paper's, draw the result
	$(BIN)/python examples/demo.py

test: lint docs ## Everything that must hold before a commit: lint, documentation, then the tests
	$(BIN)/python -m pytest $(PYTEST_ARGS)

lint: setup ## Style, format, types, import layers, spelling
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python $(CODE)
	$(BIN)/lint-imports --no-logo
	$(BIN)/codespell

# The theme says at every build that Zensical will succeed it: the variable answers that we know. (--quiet would hide the
# warnings from --strict, too.)
docs: setup ## Build the documentation into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

format: setup ## Format the code and mend what can be mended automatically
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

fast-test: setup ## The tests alone; stop at the first failure, those that failed last go first
	$(BIN)/python -m pytest $(PYTEST_ARGS) -x --failed-first

slow-test: setup ## Only the tests that train for long
	$(BIN)/python -m pytest -m slow

coverage: setup ## Branch coverage of the fast tests, 95 % at least
	$(BIN)/python -m pytest $(PYTEST_ARGS) --cov --cov-fail-under=95

# Newest releases, without addresses: the package itself and pip are left out.
lock: ## Pin anew what setup installs (in a throw-away environment)
	@scratch=$$(mktemp -d) && trap 'rm -rf "$$scratch"' EXIT \
	  && $(PYTHON) -m venv "$$scratch" \
	  && "$$scratch/bin/python" -m pip install --quiet '.[gym,plot,report,data,docs,dev]' \
	  && "$$scratch/bin/python" -m pip freeze --exclude symoden > "$$scratch/pins" \
	  && { grep '^#' requirements.lock; cat "$$scratch/pins"; } > "$$scratch/lock" \
	  && cp "$$scratch/lock" requirements.lock

clean: ## Remove the environment, caches and build outputs (never runs/)
	rm -rf $(VENV) build dist site .pytest_cache .ruff_cache .hypothesis .import_linter_cache .coverage .coverage.* htmlcov
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +
