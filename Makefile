# Everything runs in a virtual environment of its own, .venv, made on first use.
PYTHON ?= python3
TORCH  ?= torch==2.13.0
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo test check bench gate clean

demo: $(VENV)/.demo-ready        ## replay the log that ships with the project, both ways, and compare
	$(BIN)/stsem-replay logs/office.mcap --costs bench/costs/reference.json

test: $(VENV)/.test-ready        ## the whole suite, in two processes; each file's tests in one of them
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses 2 --dist loadfile

check: $(VENV)/.test-ready       ## lint, format, types, import contract
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

gate: $(VENV)/.demo-ready        ## gate this version on the shipped log
	$(BIN)/python ci/gate_shipped_log.py

bench: $(VENV)/.test-ready       ## speed, as ratios measured in one run
	$(BIN)/python -m pytest bench --benchmark-only

clean:
	rm -rf $(VENV) reports/office* .mypy_cache .ruff_cache .pytest_cache .hypothesis

$(VENV)/.demo-ready: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) --upgrade pip
	$(PIP) --editable .
	touch $@

$(VENV)/.test-ready: $(VENV)/.demo-ready pyproject.toml
	test -z "$(TORCH)" || $(PIP) "$(TORCH)"
	$(PIP) --editable '.[synth,remote,convert,openvino,quantize]' --group dev --group oracle
	test -z "$(TORCH)" || $(PIP) --editable '.[train]' --group torch-oracle
	touch $@
