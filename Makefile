# Every target does its own set-up (.ci/set-up): system libraries, .venv, native kernels.
SHELL := /usr/bin/env bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.NOTPARALLEL:

VENV := .venv/bin
PORT ?= 8000
# A worker a processor; the tests of a file stay together, as its module's fixtures are made once. Each test
# keeps to one thread, its ports and folders are its own.
PARALLEL := --numprocesses=logical --maxprocesses=8 --dist=loadfile

define step
@printf '\n== %s\n' '$(1)'
@$(2)
endef

.PHONY: help
help: ## Show what there is
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

.PHONY: run
run: ready-to-run ## Serve the operator page with a demo mission; PORT=8000
	@exec $(VENV)/hgs serve --demo --port $(PORT)

.PHONY: test
test: ready-to-test ## Everything that must be green: lint, types, layers, tests
	$(call step,ruff check,$(VENV)/ruff check .)
	$(call step,ruff format --check,$(VENV)/ruff format --check .)
	$(call step,mypy (strict),$(VENV)/mypy)
	$(call step,lint-imports (layers),$(VENV)/lint-imports --no-logo)
	$(call step,pytest,$(VENV)/pytest $(PARALLEL))

.PHONY: test-long
test-long: ready-to-test ## The tests that take minutes: whole missions, the built wheel, sanitizers
	$(call step,pytest (slow),$(VENV)/pytest -m slow --timeout=7200)
	$(call step,sanitizers,.ci/sanitize)

.PHONY: sanitize
sanitize: ready-to-test ## The kernels' tests under AddressSanitizer and UBSan, every variant
	@.ci/sanitize

.PHONY: lint
lint: ready-to-test ## Lint, format and layer contracts
	$(call step,ruff check,$(VENV)/ruff check .)
	$(call step,ruff format --check,$(VENV)/ruff format --check .)
	$(call step,lint-imports (layers),$(VENV)/lint-imports --no-logo)

.PHONY: types
types: ready-to-test ## Strict type checks
	$(call step,mypy (strict),$(VENV)/mypy)

.PHONY: format
format: ready-to-test ## Rewrite the sources in the common format
	$(VENV)/ruff check --fix .
	$(VENV)/ruff format .

.PHONY: native
native: ready-to-run ## Build the C++ kernels after a change

.PHONY: clean
clean: ## Remove the environment and everything that was built
	rm -rf .venv build .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis

.PHONY: ready-to-run ready-to-test
ready-to-run:
	@.ci/set-up run
ready-to-test:
	@.ci/set-up test
