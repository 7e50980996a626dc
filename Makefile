# Everything a fresh Debian or Ubuntu machine needs beyond Rust (rustup), make and a C compiler.
.PHONY: help setup demo test charts

help:
	@echo 'make demo    fit two shapes, serve them, sweep one through the other, draw the curves'
	@echo 'make test    run all tests; SUBLEVEL_DATA=DIR adds those of real meshes'
	@echo 'make charts  measure beside other libraries, and draw: SUBLEVEL_DATA=DIR with the meshes'
	@echo 'make setup   install missing system packages (demo and test do this first)'

setup:
	@.ci/setup

# rustup puts cargo here; a shell opened before the installation does not know it yet.
export PATH := $(PATH):$(or $(CARGO_HOME),$(HOME)/.cargo)/bin

demo: setup
	cargo run --release -- demo

# Tests of meshes that are not part of the project run where SUBLEVEL_DATA names their folder; else they are counted as ignored.
ifdef SUBLEVEL_DATA
NEXTEST_IGNORED := --run-ignored all
CARGO_IGNORED := -- --include-ignored
endif

# One profile for tests and demo: nothing is built twice.
test: setup
	@if cargo nextest --version >/dev/null 2>&1; then \
	    echo 'cargo nextest run --release --workspace $(NEXTEST_IGNORED)'; cargo nextest run --release --workspace $(NEXTEST_IGNORED); \
	else \
	    echo 'cargo test --release --workspace --lib --bins --tests $(CARGO_IGNORED)'; \
	    cargo test --release --workspace --lib --bins --tests $(CARGO_IGNORED); \
	fi
	cargo test --doc --release --workspace

charts:
	cargo run --release -p sublevel-bench -- all --data '$(SUBLEVEL_DATA)' --out docs
