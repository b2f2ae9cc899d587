# Everything runs in .venv, made by scripts/setup.py from Python >= 3.11 and the locked requirements.txt,
# of which `make fly` takes a part, requirements/fly.txt.
PYTHON ?= python3
BIN := .venv/bin
FLY := .venv/ready-to-fly
READY := .venv/ready
# keep bytecode even if the shell forbids it: commands start in half the time, and tests start hundreds
export PYTHONDONTWRITEBYTECODE :=

# two for each processor: whole flights also wait
WORKERS ?= $(shell echo $$((2 * $$(getconf _NPROCESSORS_ONLN))))

# these call equations part by part: plain Python takes less time than to compile each part for them
PLAIN := tests/plain_python.txt
COMPILED := $(addprefix --ignore=,$(shell cat $(PLAIN)))

# whole tutorials, every aircraft, rare machines: four fifths of the time of all tests
NIGHTLY := $(shell cat tests/nightly.txt)
PLAIN_NIGHTLY := $(foreach file,$(shell cat $(PLAIN)),$(filter $(file)::%,$(NIGHTLY)))
BY_DAY := $(addprefix --deselect=,$(NIGHTLY))

# threads of the linear algebra wait for each other by burning processor time; the tests are parallel
test nightly check coverage explore: export OPENBLAS_NUM_THREADS := 1

.PHONY: fly packages check test nightly coverage explore mutants docs bench fuzz soak lock clean

fly: $(FLY)  ## fly the paper's scenario 1 over MAVLink
	$(BIN)/gcs fly scenarios/paper/scenario1.yaml

packages: $(READY)  ## all packages into .venv: extras, tests, documentation

check: lint  ## for the daily loop: format, lint, types and the quick tests
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest -q -n auto --dist worksteal -m "not slow" @$(PLAIN)
	$(BIN)/pytest -q -n auto --dist worksteal -m "not slow" $(COMPILED) tests/unit tests/test_architecture.py

# a worker that dies ends the session: xdist hangs where it goes on without it
ALL := -n $(WORKERS) --dist loadfile --no-loadscope-reorder --max-worker-restart 0
test: lint  ## everything that must pass before a change: format, lint, types, tests
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest $(ALL) $(BY_DAY) @$(PLAIN)
	$(BIN)/pytest $(ALL) $(COMPILED) $(BY_DAY) tests

nightly: $(READY)  ## what must pass, too, and takes longest: whole tutorials, every aircraft, rare machines
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest $(ALL) $(PLAIN_NIGHTLY)
	$(BIN)/pytest $(ALL) $(filter-out $(PLAIN_NIGHTLY),$(NIGHTLY))

.PHONY: lint
lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy --num-workers auto
	$(BIN)/lint-imports

MUTANTS_SEED := $(or $(SEED),1)
ifeq ($(origin SEED), undefined)
SEED := $(shell od -An -N4 -tu4 /dev/urandom | tr -d ' ')
endif
coverage: $(READY)  ## lines and branches that the unit tests reach, and whether these are enough
	$(BIN)/pip install --quiet --disable-pip-version-check "pytest-cov>=7.1"
	$(BIN)/pytest -n auto --dist worksteal --cov --cov-report=term tests/unit tests/test_architecture.py

explore: $(READY)  ## the property tests with new examples, 25 times as many; SEED=... repeats a run
	@echo "make explore SEED=$(SEED) repeats this; failures are kept in .hypothesis/, tried first"
	$(BIN)/pytest -n auto --dist worksteal -m hypothesis --hypothesis-profile=explore \
	  --hypothesis-seed=$(SEED) tests/unit

mutants: $(READY)  ## small changes to the equations, 25 of each module, that no test notices; MODULE=..., NUMBER=0 (all), SEED=..., INTEGRATIONS=1
	NUMBA_DISABLE_JIT=1 $(BIN)/python scripts/find_mutants.py $(MODULE) --number $(or $(NUMBER),25) --seed $(MUTANTS_SEED) \
	  $(if $(INTEGRATIONS),--integrations)

docs: $(READY)  ## the documentation as a site in site/; every warning is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict

bench: $(READY)  ## the speed figures of docs/explanation/performance.md
	$(BIN)/python -m benchmarks

fuzz: $(READY)  ## over a million datagrams through every parser and handler; memory must stay
	$(BIN)/python -m fuzzing

soak: $(READY)  ## an hour of ten UAVs with random faults, restarts, bad links; SEED=... repeats one
	$(BIN)/python -m soak --seed $(SEED)

LOCK := uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
  --no-annotate --custom-compile-command "make lock" --quiet
# declared, as an installed ftc-sitl has them, and left out of a flight's environment: no flight imports them
NOT_TO_FLY := lxml pymavlink scipy
lock:  ## choose new dependency versions (wants uv on the PATH)
	$(LOCK) --all-extras --group build --group clone --group docs --group test --upgrade --output-file requirements.txt
	$(LOCK) --extra compile --group clone --constraint requirements.txt $(addprefix --no-emit-package ,$(NOT_TO_FLY)) \
	  --upgrade --output-file requirements/fly.txt

clean:  ## remove the environment and everything generated
	rm -rf .venv build dist site mavlink_defs/dialect.py
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

CHECK := import sys; sys.exit("ftc-sitl needs Python 3.11 or newer, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None
SETUP := requirements.txt requirements/fly.txt pyproject.toml hatch_build.py mavlink_defs/ftc.xml scripts/setup.py
$(FLY): $(SETUP)
	@$(PYTHON) -c '$(CHECK)'
	@$(PYTHON) scripts/setup.py fly
	@touch $@

$(READY): $(SETUP)
	@$(PYTHON) -c '$(CHECK)'
	@$(PYTHON) scripts/setup.py all
	@touch $(FLY) $@
