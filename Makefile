# make demo      a mesh and pictures of generated clouds, in out/
# make test      the tests that take seconds        make test-all   all of them
# make lint      ruff (its format too) and mypy     make bench      the benchmarks
# make fuzz      random clouds, files, faults and threads: N= cases from SEED=, only those of KIND=
# make docs      the site, in out/site; warnings are errors
# Each makes .venv first, and makes it again when pyproject.toml has changed. PYTHON=... chooses the interpreter.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.ONESHELL:
.DELETE_ON_ERROR:
.PHONY: demo test test-all lint bench fuzz setup

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# What the wheels load from the system: python (venv), scikit-sparse (compiler, SuiteSparse), Open3D, PyMeshLab, gmsh, polyscope.
SYSTEM := python3-venv \
	gcc g++ python3-dev libsuitesparse-dev libopenblas0-pthread \
	libgl1 libgomp1 libx11-6 libusb-1.0-0 \
	libopengl0 libegl1 \
	libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1 libfontconfig1

demo: $(STAMP)
	@mkdir -p out
	export OMP_NUM_THREADS=$${OMP_NUM_THREADS:-2}
	$(BIN)/python -c 'from face_plugin import io, shapes; \
		io.write_cloud("out/demo_points.ply", io.CloudFile(shapes.demo_shape(8000).points))'
	$(BIN)/face mesh out/demo_points.ply -o out/demo.ply
	$(BIN)/face plot out/demo_points.ply -o out/demo.png --title "Faraday cage estimation of normals"
	$(BIN)/face plot --interior out/demo_points.ply -o out/demo_interior.png --title "What the interior filter does"
	$(BIN)/python examples/which_side.py --out out --only room street

# One process a core; a file stays in one, so that what its tests share is made once.
PYTEST := $(BIN)/python -m pytest -n logical --maxprocesses 4 --dist loadfile

test: $(STAMP)
	@$(PYTEST)

test-all: $(STAMP)
	@$(PYTEST) -m "slow or not slow"

lint: $(STAMP)
	@$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	# filters/ and adapters/ lie beside the package and install into it; mypy looks for all of it in one folder.
	tree=$$(mktemp -d)
	trap 'rm -rf "$$tree"' EXIT
	mkdir "$$tree/face_plugin"
	ln -s "$$PWD"/face_plugin/* "$$PWD/filters" "$$PWD/adapters" "$$tree/face_plugin"
	repo=$$PWD
	cd "$$tree"
	"$(abspath $(BIN))/mypy" --config-file "$$repo/pyproject.toml" --cache-dir "$$repo/.mypy_cache"

bench: $(STAMP)
	@mkdir -p out
	$(BIN)/python benchmarks/scaling.py --sizes 1000 5000 20000 --output out

N ?= 1000
SEED ?= 0
fuzz: $(STAMP)
	@$(BIN)/python tests/fuzz --cases $(N) --seed $(SEED) $(if $(KIND),--kind $(KIND))

docs: $(STAMP)
	@$(BIN)/pip install --quiet --editable '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

setup: $(STAMP)

$(STAMP): pyproject.toml
	@missing=()
	if command -v dpkg-query >/dev/null; then
		for package in $(SYSTEM); do
			state=$$(dpkg-query -W -f='$${db:Status-Status}' "$$package" 2>/dev/null || true)
			[ "$$state" = installed ] || missing+=("$$package")
		done
	fi
	if [ $${#missing[@]} -gt 0 ]; then
		as_root=
		[ "$$(id -u)" = 0 ] || as_root="sudo -n"
		if command -v apt-get >/dev/null && { [ -z "$$as_root" ] || sudo -n true 2>/dev/null; }; then
			echo "Installing system libraries: $${missing[*]}"
			export DEBIAN_FRONTEND=noninteractive
			$$as_root apt-get update -qq || true
			# One by one if together fails: a name may be another on this distribution.
			$$as_root apt-get install -y -qq --no-install-recommends "$${missing[@]}" >/dev/null ||
				for package in "$${missing[@]}"; do
					$$as_root apt-get install -y -qq --no-install-recommends "$$package" >/dev/null ||
						echo "Could not install $$package; going on without it."
				done
		else
			echo "Some system libraries are missing and cannot be installed from here. Should an import fail, run:"
			echo "  sudo apt-get install $${missing[*]}"
		fi
	fi
	$(PYTHON) -c 'import sys; sys.exit("Python 3.10 or newer is needed, found " + sys.version.split()[0] if sys.version_info < (3, 10) else 0)'
	# Without the system's python3-venv a first try leaves an environment that has no pip.
	[ -x $(BIN)/pip ] || $(PYTHON) -m venv --clear $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --editable '.[dev]'
	# CHOLMOD is an extra: SciPy's SuperLU serves without it. SuiteSparse 5 (Debian 12) needs scikit-sparse 0.4.
	header=$$(ls /usr/include/suitesparse/SuiteSparse_config.h /usr/include/SuiteSparse_config.h 2>/dev/null | head -n 1 || true)
	if [ -n "$$header" ]; then
		major=$$(sed -nE 's/^#define SUITESPARSE_MAIN_VERSION[[:space:]]+([0-9]+).*/\1/p' "$$header")
		wanted=scikit-sparse
		[ "$${major:-5}" -ge 7 ] || wanted='scikit-sparse<0.5'
		$(BIN)/pip install --quiet "$$wanted" || echo "scikit-sparse could not be built; SciPy's solver is used."
	else
		echo "SuiteSparse is not installed; SciPy's solver is used, which is slower."
	fi
	touch $@
