# Everything happens in the checkout: the virtual environment in .venv, colcon's build, install and
# log beside it.  Nothing needs to be installed, sourced or root before; a sourced ROS 2 is used.

SHELL := bash
.SHELLFLAGS := -e -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup build demo test bench bench-driving bench-reduction bench-recorder experiment fuzz soak lint format clean

# An interpreter for .venv other than the one that setup.sh would choose.
PYTHON ?=
export PYTHON
# See .ci/setup.sh.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

VENV_PYTHON := .venv/bin/python
# The colcon of the environment or of the sourced ROS 2, run by the environment's Python in either
# case: that is the one which the built executables get in their first line.
COLCON := $(VENV_PYTHON) -P -c 'import sys; from colcon_core.command import main; sys.exit(main())'
QUIET := desktop_notification- status-
SOURCES := rebt_ros test setup.py .ci

help: ## Show this list.
	@sed -nE 's/^([a-z-]+):.*## (.*)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 24

setup: ## Make .venv with everything needed; once per change of the dependencies.
	@.ci/setup.sh

# Built afresh, which takes a second or two: colcon leaves modules installed that are gone from the source.
build: setup ## Build into install/; then: source install/setup.bash
	@rm -rf build/rebt_ros install/rebt_ros
	@env -u PYTHONDONTWRITEBYTECODE $(COLCON) build --packages-select rebt_ros --event-handlers $(QUIET)

demo: export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
demo: build ## Demonstrate, learn and let the learned tree drive a simulated robot (ARGS="..." for options).
	@. install/local_setup.sh && exec install/rebt_ros/lib/rebt_ros/demo $(ARGS)

# PYTHONSAFEPATH keeps the checkout off Python's path: the tests import what was installed.
# Two tests run at a time, as they mostly wait for other processes: files stay together.  A worker
# that crashed is not replaced: pytest-xdist may wait for ever then (its issues 784 and 1323).
# colcon test succeeds when tests fail; colcon test-result and the count do not.
test: export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
test: build ## Run the tests on the built package.
	@status=0; \
	PYTHONSAFEPATH=1 $(COLCON) test --packages-select rebt_ros \
	    --event-handlers console_direct+ $(QUIET) \
	    --pytest-args -n 2 --dist loadfile --max-worker-restart 0 || status=$$?; \
	$(COLCON) test-result --test-result-base build/rebt_ros --verbose || status=$$?; \
	$(VENV_PYTHON) .ci/count_tests.py build/rebt_ros/pytest.xml || status=$$?; \
	exit $$status

bench: export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
bench: setup ## Measure us and the limit in turn, for docs/performance.md (ARGS="--only tick" for options).
	@PYTHONPATH=.:test:$$PYTHONPATH $(VENV_PYTHON) test/benchmarks/bench.py $(ARGS)

bench-reduction: setup ## Compare the sizes of BT-Espresso's trees and ours (ARGS="..." for options).
	@$(VENV_PYTHON) -m rebt_ros.commands.bench_reduction ../shared/experiments $(ARGS)

bench-driving: setup ## Let what is learned drive, beside plain learners (ARGS="corrections", "--late 2", ...).
	@PYTHONPATH=.:test/benchmarks:$$PYTHONPATH $(VENV_PYTHON) -m driving $(ARGS)

bench-recorder: export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
bench-recorder: setup ## Kill, load and measure the recorder (KILLS=50; ARGS="..." for options).
	@PYTHONPATH=.:test:$$PYTHONPATH $(VENV_PYTHON) test/benchmarks/recorder.py --kills $(or $(KILLS),50) $(ARGS)

experiment: setup ## Reproduce the paper's experiments on ../shared/experiments (ARGS="..." for options).
	@$(VENV_PYTHON) -m rebt_ros.commands.experiment ../shared/experiments $(ARGS)

# Sizes are multiplied by SCALE; a SEED makes the same inputs again.
fuzz: SCALE ?= 1
fuzz: SEED ?=
fuzz: export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
fuzz: setup ## Throw mutated input at all readers and at a running executor (SCALE=0.1, SEED=7, ARGS="...").
	@PYTHONPATH=test:. $(VENV_PYTHON) -m fuzz --scale $(SCALE) $(if $(SEED),--seed $(SEED)) \
	    --output bench-results/fuzz.json $(ARGS)

soak: MINUTES ?= 10
soak: SEED ?=
soak: export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
soak: setup ## Run the nodes under load and random faults; nothing may get lost (MINUTES=10, SEED=7, ARGS=--verbose).
	@PYTHONPATH=test:. $(VENV_PYTHON) -m soak --minutes $(MINUTES) $(if $(SEED),--seed $(SEED)) \
	    --output bench-results/soak.json $(ARGS)

lint: setup ## Check style, formatting and types.
	@status=0; \
	$(VENV_PYTHON) -m ruff check $(SOURCES) || status=$$?; \
	$(VENV_PYTHON) -m ruff format --check $(SOURCES) || status=$$?; \
	$(VENV_PYTHON) -m mypy || status=$$?; \
	exit $$status

format: setup ## Format the code and sort its imports.
	@$(VENV_PYTHON) -m ruff check --select I --fix $(SOURCES)
	@$(VENV_PYTHON) -m ruff format $(SOURCES)

clean: ## Remove what was built (not .venv).
	rm -rf build install log demo-results bench-results experiment-results .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find rebt_ros test -name __pycache__ -prune -exec rm -rf {} +
