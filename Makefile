# make study [QUICK=1] [SEED=n] [DATA=folder]   gaps and their causes; with DATA also the real logs kept in that folder
# make paper [QUICK=1] [SEED=n]                 the three cases of Furlong et al. (2003); like study it writes to out/
# make reports DATA=folder                      these and the other studies into reports/, which git tracks (takes long)
# make test                                     the quick tests
# make thorough | slow | lint | bench           what takes longer; each creates .venv and installs when it has to
# make fuzz [S=600]                           mutated inputs of every kind for S seconds; make test tries a few
# make docs                                     the documentation site into out/docs, offline; warnings are errors
# make test-posterior PYTHON=python3.13 VENV=.venv313 EXTRAS=test   sampler and posterior on another Python
PYTHON ?= python3
VENV   := .venv
EXTRAS := dev
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
OUT    := out
FLAGS  := $(if $(QUICK),--quick) $(if $(SEED),--seed $(SEED))

# what depends on arviz, which is another generation from Python 3.12 on, and a whole diagnosis with draws
POSTERIOR := tests/test_sampler.py tests/test_sampler_resume.py tests/test_sample_trial.py tests/test_cli_sample.py \
	tests/test_diagnose_posterior.py tests/test_posterior_study.py tests/test_cli_diagnose.py

# rewritten asserts are kept between runs: making them anew takes each worker seven seconds
test thorough test-posterior slow: export PYTHONDONTWRITEBYTECODE =

.PHONY: help install study paper reports whole test thorough test-posterior slow fuzz lint bench docs clean
.DEFAULT_GOAL := help

help:
	@sed -n '1,8s/^# //p' Makefile

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || \
		{ echo "bayesid needs Python 3.11 or newer; '$(PYTHON)' is not on PATH. Try: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "bayesid needs Python 3.11 or newer; $(PYTHON) is `$(PYTHON) -V 2>&1`. Try: make PYTHON=python3.11"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
		{ rm -rf $(VENV); echo "$(PYTHON) cannot create a virtual environment; on Debian or Ubuntu: apt install python3-venv"; exit 1; }
	$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[$(EXTRAS)]" -c constraints.txt
	@touch $(STAMP)

study: $(STAMP)
	$(BIN)/bayesid study sim_to_real_gap --out $(OUT)/sim_to_real_gap $(FLAGS) $(if $(DATA),--data "$(DATA)")
	$(if $(DATA),$(BIN)/bayesid study real_logs --data "$(DATA)" --out $(OUT)/real_logs $(FLAGS))
	$(if $(DATA),$(BIN)/bayesid study ship_models --data "$(DATA)" --out $(OUT)/ship_models $(FLAGS))

paper: $(STAMP)
	$(BIN)/bayesid study paper_cases --out $(OUT)/paper_cases $(FLAGS)

# reports/ holds whole runs with the real logs: without them a report would lose what it says of ships
reports: OUT := reports
reports: whole study paper
	$(BIN)/bayesid study manoeuvre_richness --out $(OUT)/manoeuvre_richness $(FLAGS) --data "$(DATA)"
	$(BIN)/bayesid study posterior --out $(OUT)/posterior $(FLAGS) --data "$(DATA)"
	$(BIN)/bayesid study ridges --out $(OUT)/ridges $(FLAGS)
	$(BIN)/bayesid study calibration --out $(OUT)/calibration $(FLAGS)
	$(BIN)/bayesid study coverage --out $(OUT)/coverage $(FLAGS)
	$(BIN)/bayesid study frames --out $(OUT)/frames $(FLAGS)
	$(BIN)/bayesid study excited_terms --out $(OUT)/excited_terms $(FLAGS)
	$(BIN)/bayesid study other_equations --out $(OUT)/other_equations $(FLAGS) --data "$(DATA)"
	$(BIN)/bayesid study wind_from_motion --out $(OUT)/wind_from_motion $(FLAGS) --data "$(DATA)"
	$(BIN)/bayesid study log_mistakes --out $(OUT)/log_mistakes $(FLAGS)
	$(BIN)/bayesid study simulator_mistakes --out $(OUT)/simulator_mistakes $(FLAGS)
	$(BIN)/bayesid study robustness --out $(OUT)/robustness $(FLAGS)
	$(BIN)/bayesid study benchmark_set --out $(OUT)/benchmark_set
	$(BIN)/bayesid study sampling_rate --out $(OUT)/sampling_rate $(FLAGS)

whole:
	@test -z "$(QUICK)" || { echo "reports/ holds whole runs; leave QUICK out, or use 'make study QUICK=1'"; exit 1; }
	@test -n "$(DATA)" || { echo "reports/ speaks of real logs too; give DATA=folder (studies/real_logs/*/trial.toml)"; exit 1; }

test: $(STAMP)
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist worksteal

thorough: $(STAMP)
	$(BIN)/python -m pytest -q -m "thorough and not slow" -n auto --maxprocesses 4 --dist worksteal

test-posterior: $(STAMP)
	$(BIN)/python -m pytest -q -m "not slow" -n auto --maxprocesses 4 --dist worksteal $(POSTERIOR)

slow: $(STAMP)
	$(BIN)/python -m pytest -q -m slow -n auto --maxprocesses 4 --dist worksteal $(SLOW)

S      ?= 600
fuzz: $(STAMP)
	$(BIN)/python tests/fuzz/fuzz_inputs.py --seconds $(S) $(if $(SEED),--seed $(SEED))

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/mypy bayesid studies
	$(BIN)/lint-imports

docs: $(STAMP)
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs $(OUT)/docs
	@echo "documentation: $(OUT)/docs/index.html"

bench: $(STAMP)
	@set -e; for script in benchmarks/bench_*.py; do echo "== $$script"; $(BIN)/python "$$script"; done

clean:
	rm -rf build dist out .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
