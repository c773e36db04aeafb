# The project's commands. Each one sets up what it needs; `make help` lists them.
.DEFAULT_GOAL := help
.PHONY: help venv book course test check fresh faults recordings bench pins lint lab clean

# The first of these that runs and can make an environment; `make venv SYSTEM_PYTHON=...` takes another.
PYTHONS := python3.11 python3.12 python3.13
SYSTEM_PYTHON ?= $(firstword $(foreach python,$(PYTHONS),$(if $(shell $(python) -c 'import ensurepip, venv' 2>/dev/null && echo yes),$(python))))
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq install
SYSTEM := "import sys, sysconfig as s; print('%s-%d.%d' % (s.get_platform(), *sys.version_info[:2]))"
ENV := .venv/.installed
# What the long suites open in a browser; `make check SITE=` takes the site that is there.
SITE := book

help:  ## list these commands
	@sed -n 's/^\([a-z]*\):.*  ## /\1\t/p' Makefile | expand -t 8

venv: $(ENV)  ## make .venv with the pinned versions

book: $(ENV)  ## execute what changed and render the book to _build/html
	@$(BIN)/cpl build

course: $(ENV) .venv/.course  ## build both editions of the course, its labs and slides
	@$(BIN)/cpl course build

test: $(ENV)  ## run every test and gate, without network or browser
	@$(BIN)/python -m pytest -n 2 --cov=cpl.conformal --cov-branch --cov-report= --cov-fail-under=95

check: $(SITE) .venv/.browser .venv/.wasm  ## run the long suites: oracle, faults, rehearsal, browser
	@$(BIN)/python -m pytest -n 2 -m "oracle or faults or rehearsal" --ignore tests/robot
	@$(BIN)/python -m pytest -m "oracle or faults or rehearsal" tests/robot
	@$(BIN)/python -m pytest -m browser -n 2 tests/browser

fresh:  ## book and test on a Debian 12 with nothing else; fresh-13: on Debian 13 (root, mmdebstrap)
	@$(SYSTEM_PYTHON) -S -m tests.fresh $(if $(OUT),--out $(OUT))

fresh-%:
	@$(SYSTEM_PYTHON) -S -m tests.fresh --debian $*

faults: $(ENV)  ## provoke a few thousand faults and count how they end, into _build/faults.json
	@$(BIN)/python -m tests.faults

recordings: $(ENV)  ## fetch recordings of real machines, by name and hash, into _build/recordings
	@$(BIN)/cpl logs fetch

bench: $(ENV) .venv/.bench  ## measure speed beside other packages, into _build/bench.json
	@$(BIN)/python -m tests.bench

pins: $(ENV)  ## write the hashes of what is installed here into pins/
	@$(BIN)/python -m tests.pins

lint: $(ENV)  ## mend style and show what is left
	@$(BIN)/ruff format -q cpl tests book
	@$(BIN)/ruff check --fix cpl tests book
	@$(BIN)/pyright --pythonpath $(BIN)/python
	@$(BIN)/lint-imports
	@$(BIN)/python -m pytest -q tests/test_chapters.py

lab: $(ENV) .venv/.lab  ## open the chapters in JupyterLab
	@$(BIN)/jupyter lab book

clean:  ## remove everything that was built, but not .venv
	@rm -rf _build .pytest_cache .ruff_cache .hypothesis .import_linter_cache

# Extras are installed when first asked for, and again when the pinned versions change.
$(ENV): pyproject.toml constraints.txt
	@test -x $(BIN)/python || test -n "$(SYSTEM_PYTHON)" || \
	  { echo "make needs one of $(PYTHONS) with venv; Debian and Ubuntu call it python3-venv" >&2; exit 2; }
	@test -x $(BIN)/python || $(SYSTEM_PYTHON) -m venv .venv
	@echo "installing the pinned versions into .venv (minutes, once)"
	@$(PIP) -c constraints.txt --no-deps torch
	@$(call hashed,)
	@$(PIP) -c constraints.txt --no-build-isolation -e ".[book,test]"
	@touch $@

# Where hashes are kept for this system and Python, a file with another content is refused; `make pins`
# writes them. torch is excepted: it is taken in the build that this machine has.
hashed = pins=pins/$$($(BIN)/python -c $(SYSTEM))$(1).txt; \
  if test -f "$$pins"; then $(PIP) --no-deps --require-hashes -r "$$pins"; \
  else $(PIP) -c constraints.txt setuptools; fi

.venv/.%: $(ENV)
	@$(call hashed,-$*)
	@$(PIP) -c constraints.txt --no-build-isolation -e ".[$*]"
	@touch $@
