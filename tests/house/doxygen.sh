#!/usr/bin/env bash
# doxygen.sh ROOT: doxygen has no warning about the public headers and the documents.
set -euo pipefail
cd "$1"
output=$(mktemp -d)
trap 'rm -rf "$output"' EXIT
doxygen <(cat Doxyfile; echo "OUTPUT_DIRECTORY = $output")
[[ -s $output/html/index.html ]]
echo "$(find "$output/html" -name '*_8h.html' | wc -l) headers"
