# What tests/run.sh and examples/quickstart.sh begin with; to be sourced. Needs bash. Words go to stderr.
# shellcheck shell=bash
set -euo pipefail
unset CDPATH

project=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
jobs=$(nproc)

# All that building and testing needs on Debian 12, beyond what every installation has.
packages=(
    g++ cmake ninja-build ccache
    libopenvdb-dev libboost-iostreams-dev # OpenVDB's headers include Boost.Iostreams, its package does not depend on it
    libcgal-dev libopenmesh-dev libeigen3-dev libtbb-dev
    nlohmann-json3-dev libcli11-dev libspdlog-dev libfmt-dev
    libgtest-dev libbenchmark-dev
)

# Installs what is missing of `packages`: as root or by passwordless sudo, else says what to run and ends the script.
install_packages() {
    if ! command -v dpkg-query >/dev/null; then
        echo "This is not Debian: nothing is installed. The packages are called there: ${packages[*]}" >&2
        return
    fi
    local package missing=() as_root=()
    for package in "${packages[@]}"; do
        [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
    done
    [ ${#missing[@]} -gt 0 ] || return 0
    echo "Missing packages: ${missing[*]}" >&2
    if [ "$(id -u)" -ne 0 ]; then
        if ! sudo -n true 2>/dev/null; then
            echo "They need an administrator to install them; then run this again:" >&2
            echo "  sudo apt-get update && sudo apt-get install --no-install-recommends ${missing[*]}" >&2
            exit 1
        fi
        as_root=(sudo -n)
    fi
    as_root+=(env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300)
    { "${as_root[@]}" update && "${as_root[@]}" install -y --no-install-recommends "${missing[@]}"; } >&2 </dev/null
}

# Configures build/ in the project's root. A build folder that exists keeps its generator.
configure() {
    local arguments=()
    if [ ! -f "$project/build/CMakeCache.txt" ] && command -v ninja >/dev/null; then arguments+=(-G Ninja); fi
    # ccache fails every compilation where it cannot write, as for a user without a home.
    local cache
    if cache=$(ccache --get-config cache_dir 2>/dev/null) && mkdir -p "$cache" 2>/dev/null && [ -w "$cache" ]; then
        arguments+=(-D CMAKE_CXX_COMPILER_LAUNCHER=ccache)
    fi
    cmake -S "$project" -B "$project/build" "${arguments[@]}" "$@"
}
