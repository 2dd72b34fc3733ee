#!/usr/bin/env bash
# The peers on a small sphere: ends well and prints a row of finite numbers for every method.
# usage: peers_smoke.sh PROGRAM PEERS
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$1" -q generate sphere -o "$work/sphere.####.vdb" --frames 2 --voxel 0.04
"$2" "$work" --csv >"$work/rows.csv"
for method in 'volumeToMesh 0' 'volumeToMesh 0.1' decimation isotropic_remeshing 'make_surface_mesh 0.3vx' \
    'make_surface_mesh as isotrack' 'make_surface_mesh as isotrack --fit' isotrack 'isotrack --fit'; do
    # Frame, method and fourteen columns; the ratios at the end belong to isotrack alone.
    if ! grep -E "^2,$method(,[0-9][-+0-9.e]*){9},1,2,[0-9]+,(true|false),(true|false)," "$work/rows.csv"; then
        echo "no sound row for $method in:"
        cat "$work/rows.csv"
        exit 1
    fi
done
grep -Eq '^2,isotrack --fit,.*,[0-9][-+0-9.e]*,[0-9][-+0-9.e]*$' "$work/rows.csv"
