#!/usr/bin/env bash
# install-packages.sh GROUP...: sees to it that the Debian packages of the groups "build", "build-tests" (what the
# tests are configured and built with), "test" (what they run besides) and "package" are there. Installs what is missing as root or through sudo; otherwise prints the one command
# that would and exits with 2. Asks nothing and touches nothing when everything is there.
set -euo pipefail

missing=()

has() { command -v "$1" >/dev/null 2>&1; }
installed() {
  has dpkg-query && [[ $(dpkg-query -W -f='${Status}' "$1" 2>/dev/null) == *"ok installed" ]]
}
need_command() { has "$1" || missing+=("$2"); }
# A library counts as there when pkg-config knows it, so that one from elsewhere is respected.
need_library() {
  if has pkg-config && [[ $1 != - ]] && pkg-config --exists "$1"; then return; fi
  installed "$2" || missing+=("$2")
}

build_packages() {
  { has gcc && has g++ && has make && installed libc6-dev; } || missing+=(build-essential)
  need_command cmake cmake
  need_command ninja ninja-build
  need_command pkg-config pkg-config
  need_library libpng libpng-dev
  need_library libjpeg libjpeg-dev
  need_library sqlite3 libsqlite3-dev
  need_library libmd libmd-dev # SHA-1 and SHA-256
  need_library openssl libssl-dev # TLS of a class
  need_library yaml-0.1 libyaml-dev
  need_library minizip libminizip-dev # packages of SCORM
  need_library - libnifti2-dev # no pkg-config file
  need_library zlib zlib1g-dev
  installed python3-dev || missing+=(python3-dev) # the package for Python
  need_command node nodejs
  if ! has npm; then missing+=(npm ca-certificates); fi
}

build_tests_packages() {
  need_library libcjson libcjson-dev # a second reader of JSON
  need_library cmocka libcmocka-dev
  need_library ccd libccd-dev
  need_library hdf5 libhdf5-dev # data sets as HDF5, and a reader of them
  need_command ld.lld lld # links hundreds of tests in a third of the time
  if [[ $(uname -m) == x86_64 ]]; then # another C library and another processor give the same bits
    need_command musl-gcc musl-tools
    need_command aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu
    installed libc6-dev-arm64-cross || missing+=(libc6-dev-arm64-cross)
    need_command qemu-aarch64 qemu-user
  fi
}

test_packages() {
  installed python3-h5py || missing+=(python3-h5py)
  need_command clang clang
  need_command clang-format-14 clang-format-14
  need_command clang-tidy-14 clang-tidy-14
  need_command doxygen doxygen
  if has clang; then
    local runtime
    runtime=$(clang -print-file-name=libclang_rt.asan-x86_64.a)
    [[ -e $runtime || $(uname -m) != x86_64 ]] || missing+=(libclang-rt-14-dev)
  else
    missing+=(libclang-rt-14-dev)
  fi
  has chromium || has google-chrome || missing+=(chromium)
  need_command mandoc mandoc
  need_command abidiff abigail-tools # compares public interfaces
  need_command teem-unu teem-apps
  need_command mpirun openmpi-bin # starts ranks of a cohort
  need_command dciodvfy dicom3tools # validates DICOM files
  need_command storescp dcmtk       # reads them, and is an archive to send them to
  [[ -x /usr/sbin/Orthanc ]] || missing+=(orthanc) # an archive as hospitals run it
  installed libopenigtlink-dev || missing+=(libopenigtlink-dev) # a receiver of OpenIGTLink, and its
  installed openigtlink-examples || missing+=(openigtlink-examples) # source text
  need_command ccx calculix-ccx # a separate finite-element program that solves the same press
  installed python3-numpy || missing+=(python3-numpy)
  installed python3-setuptools || missing+=(python3-setuptools)
  installed python3-wheel || missing+=(python3-wheel)
  installed python3-cloudpickle || missing+=(python3-cloudpickle) # of Gymnasium, where it is there
  installed python3-typing-extensions || missing+=(python3-typing-extensions)
  installed python3-vtk9 || missing+=(python3-vtk9) # reads MetaImage and NRRD files as others do
}

package_packages() {
  need_command dpkg-buildpackage dpkg-dev
  need_command dh debhelper
  need_command dh_python3 dh-python
  need_command lintian lintian
  need_command reuse reuse
}

check_node() {
  local major
  major=$(node --version | sed 's/^v\([0-9]*\).*/\1/')
  if ((major < 18)); then
    echo "node $(node --version) is too old: the page is built with node 18 or newer" >&2
    exit 2
  fi
}

as_root() { # no prompt when nobody can answer it
  if [[ $(id -u) == 0 ]]; then "$@"
  elif [[ -t 0 ]]; then sudo "$@"
  else sudo -n "$@"; fi
}

may_be_root() {
  [[ $(id -u) == 0 ]] && return 0
  has sudo || return 1
  [[ -t 0 ]] || sudo -n true 2>/dev/null
}

install_missing() {
  local command="apt-get install --no-install-recommends -y ${missing[*]}"
  if ! has apt-get; then
    echo "missing: ${missing[*]} (Debian 12 package names; there is no apt-get here)" >&2
    exit 2
  fi
  if ! may_be_root; then
    echo "packages are missing; as root, run:" >&2
    echo "  apt-get update && $command" >&2
    exit 2
  fi
  echo "== packages: installing ${missing[*]}"
  local apt=(as_root env DEBIAN_FRONTEND=noninteractive apt-get -q)
  "${apt[@]}" update || { sleep 5; "${apt[@]}" update; }
  # Orthanc is wanted as a program that a test starts. Its package would start a service, now and at every
  # boot, and fail where none can be started.
  local policy=/usr/sbin/policy-rc.d code=0 own=
  if [[ " ${missing[*]} " == *" orthanc "* && ! -e $policy ]]; then
    own=$policy
    as_root sh -c "printf '#!/bin/sh\nexit 101\n' >$policy && chmod 755 $policy"
  fi
  "${apt[@]}" install --no-install-recommends -y "${missing[@]}" || code=$?
  [[ -z $own ]] || as_root rm -f "$own"
  [[ " ${missing[*]} " != *" orthanc "* ]] || as_root update-rc.d orthanc disable || true
  return "$code"
}

for group in "$@"; do
  case $group in
  build) build_packages ;;
  build-tests) build_tests_packages ;;
  test) test_packages ;;
  package) package_packages ;;
  *) echo "install-packages.sh: unknown group '$group', expected build, build-tests, test or package" >&2; exit 2 ;;
  esac
done
if ((${#missing[@]})); then
  install_missing
else
  echo "== packages: all there ($*)"
fi
check_node
