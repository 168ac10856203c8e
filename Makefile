# Every target works on a fresh machine with Python >= 3.11 (with venv), a Rust toolchain, a C linker and make.
# Set PYTHON to use an interpreter other than python3. No target needs root.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
DIST ?= dist
# By zig the wheel needs no newer glibc than 2.17. Builds for macOS and Windows set other flags.
WHEEL_FLAGS ?= --zig --compatibility manylinux2014
RUST_SOURCES := Cargo.toml Cargo.lock $(shell find rust -name '*.rs' -o -name Cargo.toml)

.DEFAULT_GOAL := help
.PHONY: help setup lock dev run cluster test test-rust test-python test-all lint lint-rust format bench validate site docs web types licences npm wheel release clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-12s %s\n", $$1, $$2}'

setup: $(VENV)/.library $(VENV)/.service ## the environment in .venv, with the release build of the extension

# The hashes are of the files of all platforms and Pythons; --upgrade takes the newest versions that are allowed.
lock: $(VENV)/.venv ## choose anew the versions that serve, with their hashes, in service/requirements.txt
	$(BIN)/pip install --quiet 'uv>=0.9,<1'
	$(BIN)/python -c "$$NEEDED" | $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 \
	--generate-hashes --no-annotate --custom-compile-command 'make lock' --output-file service/requirements.txt -

# cargo-about reads the crates that are on this machine: cargo install cargo-about --locked --features cli
licences: ## write the licences of the crates in the compiled module anew, after Cargo.lock has changed
	cargo about generate --locked --offline --fail --config rust/licences/about.toml \
	--manifest-path rust/bindings/Cargo.toml rust/licences/about.hbs | sed 's/[ \t]*$$//' >rust/licences/THIRD-PARTY.txt

dev: setup $(VENV)/.dev ## what tests, linters and the laboratory need besides

run: setup ## set up, then the service with its page on 127.0.0.1:8000
	$(BIN)/hybridmpm serve

cluster: setup ## set up, then two nodes of the service behind HAProxy on http://127.0.0.1:8000
	service/deploy/cluster.sh $(BIN)/python

test: test-rust test-python ## set up, then the whole default test suite

test-rust: ## tests of the Rust crates alone; they need no Python
	cargo test --locked

# Tests wait for servers and browsers a third of their time: one worker more than there are cores.
test-python: dev ## tests of library, service and page on all cores; lists the slowest
	$(BIN)/pytest --numprocesses $$(($$($(BIN)/python -c 'import os; print(os.cpu_count())') + 1)) --durations 10

# Two of them take ten minutes and wait for most of it, so workers take tests from each other.
test-all: test ## the default suite, then the long twins of its tests, within an hour on two cores
	$(BIN)/pytest -m long --numprocesses auto --dist worksteal --durations 10

lint: dev lint-rust ## ruff, mypy --strict, the stub, clippy and rustfmt; changes nothing
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest --concise hybridmpm._native

lint-rust: $(VENV)/.venv
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo clippy --locked --workspace --all-targets -- -D warnings
	cargo fmt --all --check

format: dev ## format Python and Rust
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	cargo fmt --all

bench: dev ## time the solver on one thread
	$(BIN)/python -m hybridmpm_lab speed --threads 1

validate: dev ## compare the solver with experiments and closed forms, and renew docs/results/validation
	$(BIN)/python -m hybridmpm_lab validate --out docs/results/validation

site: setup ## write the gallery as pages that play, a static folder for any web host: dist/site
	$(BIN)/python -m hybridmpm_service.site dist/site

web: ## build the WebAssembly modules of playing pages; rust/web/build.sh names what it needs
	rust/web/build.sh

types: setup ## write the types of the client in JavaScript anew, after calls of the service have changed
	$(BIN)/python -m hybridmpm_service.typescript

docs: setup $(VENV)/.docs ## the documentation as a site in dist/docs, which needs no server and no network
	$(BIN)/python -m sphinx --fail-on-warning --quiet -c docs/sphinx . $(DIST)/docs

# Archives carry the time of the last commit and no path of the machine, so that two builds are equal.
wheel release: export SOURCE_DATE_EPOCH ?= $(shell git log -1 --format=%ct)
wheel release: export RUSTFLAGS = --remap-path-prefix=$(CURDIR)=. --remap-path-prefix=$(or $(CARGO_HOME),$(HOME)/.cargo)=cargo
# What the SBOM says of the crates here names their folders; packed anew, the wheel does not.
wheel: $(VENV)/.release ## the library's wheel for this platform in dist; WHEEL_FLAGS go to maturin
	rm -rf target/wheel/packed
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/maturin build --release --locked --target-dir target/wheel --interpreter $(BIN)/python \
	$(WHEEL_FLAGS) --out target/wheel/packed
	$(BIN)/python -m wheel unpack --dest target/wheel/packed target/wheel/packed/*.whl
	perl -pi -e 's|\Q$(CURDIR)\E|/hybridmpm|g' target/wheel/packed/*/*.dist-info/sboms/*.json
	mkdir -p $(DIST) && $(BIN)/python -m wheel pack --dest-dir $(DIST) target/wheel/packed/*/

# npm sets the times in the archive itself.
npm: ## the client in JavaScript as a package for npm in dist; needs npm, and uploads nothing
	rm -rf $(DIST)/npm && mkdir -p $(DIST)/npm/share
	cp service/npm/* LICENSE $(DIST)/npm
	cd service/hybridmpm_service/page && cp api.d.ts client.* element.* frames.js $(abspath $(DIST))/npm && cp share/log-link.js $(abspath $(DIST))/npm/share
	cd $(DIST)/npm && npm pack --silent --pack-destination ..
	rm -r $(DIST)/npm

release: wheel npm ## all that a release consists of in dist, with checksums and its text; uploads nothing
	$(BIN)/maturin sdist --out $(DIST)
	cd service && ../$(BIN)/python -m hatchling build --directory $(abspath $(DIST))
	awk '/^## /{n++} n==1' CHANGELOG.md >$(DIST)/RELEASE.md
	cd $(DIST) && sha256sum *.whl *.tar.gz *.tgz >SHA256SUMS && cat SHA256SUMS

clean: ## remove the environment and all builds
	rm -rf $(VENV) target dist

define NEEDED
import tomllib
for file in "pyproject.toml", "service/pyproject.toml":
    with open(file, "rb") as project:
        names = tomllib.load(project)["project"]["dependencies"]
    print(*(name for name in names if name != "hybridmpm"), sep="\n")
endef
export NEEDED

# Each stamp names what its step depends on, so that a second `make` does nothing.
$(VENV)/.venv:
	$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(None if v >= (3, 11) else f"Python >= 3.11 is needed, $(PYTHON) is {v[0]}.{v[1]}")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	touch $@

# What library and service need is fetched while the extension compiles. pip installs what maturin built, because
# maturin would install the dev group as well, which has torch.
$(VENV)/.library: $(VENV)/.venv pyproject.toml $(RUST_SOURCES)
	$(BIN)/pip install --quiet 'maturin>=1.9,<2'
	$(BIN)/python -c "$$NEEDED" | $(BIN)/pip install --quiet --requirement /dev/stdin & needed=$$!; \
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --locked --skip-install; built=$$?; \
	wait $$needed && exit $$built
	PATH="$(CURDIR)/$(BIN):$$PATH" MATURIN_PEP517_ARGS=--locked \
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

$(VENV)/.service: $(VENV)/.library service/pyproject.toml
	$(BIN)/pip install --quiet --editable service
	touch $@

$(VENV)/.dev: $(VENV)/.service pyproject.toml lab/pyproject.toml
	$(BIN)/pip install --quiet --group dev
	$(BIN)/pip install --quiet --no-deps --editable lab
	touch $@

$(VENV)/.release: $(VENV)/.venv pyproject.toml
	$(BIN)/pip install --quiet --group release
	touch $@

$(VENV)/.docs: $(VENV)/.venv pyproject.toml
	$(BIN)/pip install --quiet --group docs
	touch $@
