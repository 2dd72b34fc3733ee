# What the tests of the commands share; to be sourced, in bash. Leaves the shell in an empty folder that goes at the end.
# shellcheck shell=bash
set -u
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failures=0

# expect CODE PATTERN COMMAND...: the exit code, and a pattern in what comes out on both streams
expect() {
    local code=$1 pattern=$2 output got
    shift 2
    output=$("$@" 2>&1)
    got=$?
    if [ "$got" -ne "$code" ] || ! grep -qE -- "$pattern" <<<"$output"; then
        printf 'expected exit %s and "%s", got exit %s from: %s\n%s\n' "$code" "$pattern" "$got" "$*" "$output"
        failures=$((failures + 1))
    fi
}
