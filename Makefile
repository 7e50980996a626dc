# Everything a fresh Debian or Ubuntu machine needs beyond Rust (rustup), make and a C compiler.
.PHONY: help setup demo test check charts docs-numbers image acceptance endurance fuzz draws measures kills soak solvers robots

help:
	@echo 'make demo          fit two shapes, serve them, sweep one through the other, draw the curves'
	@echo 'make test          run all tests; SUBLEVEL_DATA=DIR adds those of real meshes'
	@echo 'make check         everything a change must pass, as continuous integration runs it: SUBLEVEL_DATA=DIR'
	@echo 'make charts        measure beside other libraries, and draw: SUBLEVEL_DATA=DIR with the meshes'
	@echo 'make docs-numbers  write the numbers of README.md and docs/ again from the CSV files in docs/'
	@echo 'make image         build the container image of the server: BUILD= names another base image'
	@echo 'make acceptance    what is too long for every change, all eight of these: SUBLEVEL_DATA=DIR'
	@echo '  make endurance     1e8 checked queries; interrupted, it continues where it was (QUERIES=1e9 for more)'
	@echo '  make fuzz          1e6 damaged inputs for each reader of files and calls (RUNS=10000000 for more)'
	@echo '  make draws         5e3 draws of each family of the stability tests, an hour (DRAWS=100000 for a day of them)'
	@echo '  make measures      time every measure beside coal and parry, and fail where a target is missed'
	@echo '  make kills         kill a server under load 1e3 times, with a ledger of its answers (KILLS=100 for fewer)'
	@echo '  make soak          load a server for half an hour, and see its memory and descriptors (SOAK=60 for a minute)'
	@echo '  make solvers       all tests of fits with each of the two solvers alone'
	@echo '  make robots        1e5 states of an arm against its raw meshes, and its SRDF against what is proven'
	@echo 'make setup         install missing system packages (demo and test do this first)'

setup:
	@.ci/setup

# rustup puts cargo here; a shell opened before the installation does not know it yet.
export PATH := $(PATH):$(or $(CARGO_HOME),$(HOME)/.cargo)/bin

demo: setup
	cargo run --release -- demo

# Tests of meshes that are not part of the project run where SUBLEVEL_DATA names their folder; else they are left out.
test: setup
	@.ci/test

check:
	@.ci/check

charts:
	cargo run --release -p sublevel-bench -- all --data '$(SUBLEVEL_DATA)' --out docs

docs-numbers:
	cargo run --release -p sublevel-bench -- tables --out docs README.md

image:
	docker build -f deploy/container/Containerfile --target server $(if $(BUILD),--build-arg BUILD=$(BUILD)) -t sublevel .

acceptance: endurance fuzz draws measures kills soak solvers robots

QUERIES ?= 1e8
RUNS ?= 1000000
DRAWS ?= 5000
KILLS ?= 1000
SOAK ?= 1800

# Runs of different lengths keep states of their own.
endurance: setup
	@mkdir -p target/acceptance
	OPENBLAS_NUM_THREADS=1 cargo bench -p sublevel-bench --bench endurance -- --queries $(QUERIES) --threads 2 \
	    --state target/acceptance/endurance-$(QUERIES).json --summary target/acceptance/endurance-$(QUERIES).md

fuzz:
	fuzz/run $(RUNS)

draws: setup
	SUBLEVEL_LONG=$(DRAWS) cargo test --release -p sublevel-core --test stability
	SUBLEVEL_LONG=$(DRAWS) cargo test --release -p sublevel-fit --test solvers degenerate_clouds

measures:
	@[ -d '$(SUBLEVEL_DATA)' ] || { echo 'measures: the meshes are missing; name their folder: SUBLEVEL_DATA=DIR make measures' >&2; exit 1; }
	cargo bench -p sublevel-bench --bench measures -- --strict

kills: setup
	SUBLEVEL_LONG=$(KILLS) cargo test --release --test server kills:: -- --nocapture

soak: setup
	SUBLEVEL_LONG=$(SOAK) cargo test --release --test server soak:: -- --nocapture

# Left out: the choice of the solver itself, and a sphere as a set of degree 4, which clarabel alone refuses. Tests in
# other files of crates/fit/tests/ name their solver, or have programs that clarabel alone solves.
solvers: setup
	@[ -d '$(SUBLEVEL_DATA)' ] || { echo 'solvers: the meshes are missing; name their folder: SUBLEVEL_DATA=DIR make solvers' >&2; exit 1; }
	for solver in clarabel structured; do \
	    SUBLEVEL_TEST_SOLVER=$$solver cargo test --release -p sublevel-fit --lib --test meshes --test parts --test sweep \
	        -- --include-ignored \
	        --skip tests::both_solvers_are_tried_unless_one_is_asked_for \
	        --skip tests::sos::bad_input_is_refused_by_field || exit 1; \
	done

robots: setup
	@[ -d '$(SUBLEVEL_DATA)' ] || { echo 'robots: the arm is missing; name the folder of the data: SUBLEVEL_DATA=DIR make robots' >&2; exit 1; }
	SUBLEVEL_LONG=1 cargo test --release -p sublevel-bench --lib panda:: -- --include-ignored --nocapture
