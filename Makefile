# Needs nothing but python3 >= 3.11 and make: every target makes .venv as needed.

PYTHON ?= python3
BIN := .venv/bin
RUNTIME := .venv/.runtime
INSTALLED := .venv/.installed
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable
# One thread per worker in the linear algebra library: two workers share the machine.
QUIET_THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

.PHONY: run paper test kernels test-slow lint docs lock bench bench-all explorer clean

run: $(INSTALLED)
	$(BIN)/equimorph run examples/arch.toml

paper: $(INSTALLED)
	$(BIN)/equimorph paper

# First all kernels, each once, on all cores: two workers would compile most of them twice.
test: $(INSTALLED) kernels
	$(QUIET_THREADS) $(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow"

# From the sources, even while the package is installed anew with more requirements.
kernels: $(RUNTIME)
	PYTHONPATH=src $(BIN)/python -m equimorph.linalg.compile_ahead

# `make test-slow TENTH=3` runs a tenth of them; TENTH is any number, its last digit counts. They
# repeat with more cases what fast tests do, whose shapes are checked.
test-slow: $(INSTALLED)
	EQUIMORPH_SHAPES=unchecked $(QUIET_THREADS) $(BIN)/python -m pytest -n 2 --dist worksteal -m slow $(if $(TENTH),--tenth $(TENTH))

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers 2
	$(BIN)/lint-imports

# Sphinx keeps pages that have not changed; `make clean` removes them. No network is needed to read or to build.
docs: .venv/.docs
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --jobs 2 docs results/docs
	@echo "results/docs/index.html"

# Versions with hashes for whoever wants exactly these; the other targets do not use them.
lock:
	uv pip compile pyproject.toml --extra dev --extra docs --universal --generate-hashes --quiet \
	    --no-header --no-annotate --output-file requirements-dev.lock

bench: $(INSTALLED)
	$(BIN)/python benchmarks/report.py results/bench.json $(if $(BEFORE),--before $(BEFORE)) $(GROUPS)

# Many more cases, in tables.
bench-all: $(INSTALLED)
	$(BIN)/python -m pytest -o addopts="--import-mode=importlib" -p no:xdist --benchmark-only benchmarks

# The program of the explorer's page, for whoever changes it: needs node, which nothing else does.
explorer: explorer/node_modules
	cd explorer && npx tsc && node build.mjs

explorer/node_modules: explorer/package-lock.json
	cd explorer && npm ci --no-fund --no-audit
	touch $@

clean:
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks \
	    results dist explorer/node_modules
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(RUNTIME): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "equimorph needs Python 3.11 or newer; say: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(INSTALL) .
	touch $(RUNTIME)

# What `make run` needs is compiled meanwhile, from the sources: see `kernels`.
$(INSTALLED): $(RUNTIME)
	PYTHONPATH=src $(BIN)/python -m equimorph.cli compile examples/arch.toml & \
	    $(INSTALL) '.[dev]' && touch $(INSTALLED); status=$$?; wait; exit $$status

.venv/.docs: $(INSTALLED)
	$(INSTALL) '.[dev,docs]'
	touch .venv/.docs
