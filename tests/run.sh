#!/usr/bin/env bash
# Installs what is missing, builds everything and runs the tests. Ends with ctest's own summary and exit code.
# Arguments go to ctest: tests/run.sh -R LevelSet
. "$(dirname "${BASH_SOURCE[0]}")/bootstrap.sh"

install_packages
configure -D ISOTRACK_BUILD_TESTS=ON -D ISOTRACK_BUILD_EXAMPLES=ON -D ISOTRACK_INSTALL=ON
cmake --build "$project/build" --parallel "$jobs"
exec ctest --test-dir "$project/build" --output-on-failure --parallel "$jobs" "$@"
