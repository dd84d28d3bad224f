# One command each; `make demo` and `make test` install first.
PYTHON ?= python3.11
BIN := .venv/bin
INSTALLED := .venv/.installed

# make up DB=postgresql PORT=4201 STATE=/srv/mocoflow; a site keeps its database and port.
SITE = $(BIN)/python -m flows.production
STATE_FOLDER = $(if $(STATE),--state $(STATE))

.PHONY: install demo up down test e2e cluster faults stability bench check format audit

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

demo: install
	$(BIN)/mocoflow demo --out demo

# A Prefect server with its database, all deployments and a worker, until `make down`.
up: install
	$(SITE) up $(if $(DB),--database $(DB)) $(if $(PORT),--port $(PORT)) $(STATE_FOLDER)

down: install
	$(SITE) down $(STATE_FOLDER)

# A file's tests stay together: they share what they make.
test: install
	$(BIN)/python -m pytest -n 2 --dist loadfile

# Whole processes: killed ranks and runs, a server with a worker. Nine minutes.
e2e: install
	$(BIN)/python -m pytest -m e2e

# Benchmarks in several processes and on a Dask cluster, who can reach them, who is told.
cluster: install
	$(BIN)/python -m pytest -m cluster

# What is lost when something dies or breaks: docs/reliability.md. Half an hour.
faults: install
	$(BIN)/python -m pytest -m faults

stability: install
	$(BIN)/mocoflow stability --out stability

bench: install
	$(BIN)/python -m benchmarks.work_precision

check: install
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: install
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Known vulnerabilities of the pinned packages. Asks the network; a package that it cannot ask about
# is a failure, as is one that has any. The tool stays out of the project's own environment.
audit:
	test -x .venv-audit/bin/pip-audit || $(PYTHON) -m venv .venv-audit
	.venv-audit/bin/python -m pip install --quiet --disable-pip-version-check pip-audit==2.10.1
	.venv-audit/bin/pip-audit --strict --no-deps --disable-pip -r constraints.txt
