# Every target does its own set-up: a fresh machine needs python3, make and a package registry.
PYTHON ?= python3
BIN := .venv/bin
RUNS := .venv/.runs
READY := .venv/.ready
WARM := .venv/.warm
WORKERS ?= auto

# Python keeps the bytecode of what it imports, also where the environment forbids that: a start without takes 5 s.
export PYTHONDONTWRITEBYTECODE :=

# GNU's C library keeps the memory of one test for the next, as it does for the runs of a campaign: a twentieth of the time.
KEPT := MALLOC_TRIM_THRESHOLD_=268435456 MALLOC_MMAP_THRESHOLD_=33554432

.DEFAULT_GOAL := demo
.PHONY: install demo test test-all check format bench docs notebooks messages kernels release lock clean

install: $(WARM)

# It installs and compiles what it needs itself: a quarter of the packages, and what does not come with the package.
demo: $(RUNS)
	$(BIN)/python examples/demo.py

test: $(WARM)
	$(KEPT) $(BIN)/python -m pytest -q -n $(WORKERS) --dist loadscope --no-loadscope-reorder -m "not slow"

test-all: $(WARM)
	$(KEPT) $(BIN)/python -m pytest -q -n $(WORKERS) --dist loadscope --no-loadscope-reorder

fuzz: $(READY)
	FUZZ=$(or $(FUZZ),6500) $(BIN)/python -m pytest -q -n $(WORKERS) tests/fuzz

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy examples

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The libraries that we are compared with have an environment of their own.
bench: $(WARM)
	test -x .peers/bin/python || $(PYTHON) -m venv .peers
	$(BIN)/uv pip install -q --python .peers/bin/python -r benchmarks/peers.txt -e .
	.peers/bin/python -m benchmarks

docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q
	@echo "build/site/index.html"

notebooks: $(READY)
	$(BIN)/python docs/notebooks/build.py

messages: $(READY)
	$(BIN)/python -m tests.report.catalogue

# Machine code that comes with the package. An edit of a kernel leaves it unused, and the kernel is compiled as any other.
kernels: $(READY)
	$(BIN)/python .ci/kernels.py

release: kernels
	$(BIN)/python .ci/release.py

# All extras but cuda: NVIDIA's compiler is half a gigabyte, of use only where there is a device.
LOCKED := plot ros zenoh ublox septentrio novatel px4 ardupilot cluster tune magnetometer live test dev docs bench

lock: $(READY)
	$(BIN)/uv pip compile pyproject.toml $(LOCKED:%=--extra %) --universal --python-version 3.11 --generate-hashes \
	  --no-emit-index-url --custom-compile-command "make lock" --upgrade -q -o requirements.lock

# The stamps are touched last, so an interrupted installation is started again. What the program needs to run comes first, in
# the versions of the lock; uv holds what it gets, build tools too, against the hashes there.
$(RUNS): requirements.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -q uv
	$(BIN)/uv pip install -q --python $(BIN)/python --constraints requirements.lock --build-constraints requirements.lock -e .
	touch $@

$(READY): $(RUNS)
	$(BIN)/uv pip sync -q --python $(BIN)/python --require-hashes requirements.lock
	$(BIN)/uv pip install -q --python $(BIN)/python --no-deps --no-build-isolation -e .
	touch $@

# Compiled code is kept in the user's cache; a second call finds it there.
$(WARM): $(READY)
	$(BIN)/truenorth warm
	touch $@

clean:
	rm -rf .venv .peers build dist .pytest_cache .mypy_cache .ruff_cache
