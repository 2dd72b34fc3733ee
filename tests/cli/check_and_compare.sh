#!/usr/bin/env bash
# isotrack check and isotrack compare as a user runs them: what they print and how they exit.
# usage: check_and_compare.sh PROGRAM
. "$(dirname "${BASH_SOURCE[0]}")/support.sh"

# A tetrahedron of the given triangles.
tetrahedron() { printf '%s\n' OFF "4 $# 0" '0 0 0' '1 0 0' '0 1 0' '0 0 1' "${@/#/3 }"; }
tetrahedron '0 2 1' '0 1 3' '0 3 2' '1 2 3' >sound.off
tetrahedron '0 2 1' '0 1 3' '0 3 2' >open.off
tetrahedron '0 1 2' '0 3 1' '0 2 3' '1 3 2' >inward.off

expect 0 'sound.off +4 +4 +1 +0 +yes +yes +yes' "$program" check sound.off
expect 3 '3 border edges' "$program" check sound.off open.off
expect 3 'inside out' "$program" check inward.off
expect 1 'missing.off' "$program" check missing.off sound.off
expect 3 '"problems": "3 border edges"' "$program" check --json open.off

"$program" -q generate sphere -o 'in.####.vdb' --frames 3 --voxel 0.04 || exit 1
"$program" -q mesh 'in.####.vdb' -o 'out.####.ply' || exit 1
expect 0 '^ +2 +volumeToMesh 0.1 ' "$program" compare 'in.####.vdb'
expect 0 '^2,isotrack,' "$program" compare 'in.####.vdb' --meshes 'out.####.ply' --csv
expect 0 '"method": "volumeToMesh 0.5"' "$program" compare in.0001.vdb --adaptivity 0.5 --json
expect 0 '^info: isotrack: ' "$program" compare in.0001.vdb -o rows.csv
expect 0 '^1,volumeToMesh 0,' cat rows.csv
expect 2 'expected a file' "$program" compare in.0001.vdb -o .
expect 2 'put ####' "$program" compare 'in.####.vdb' --meshes out.0001.ply
rm out.0002.ply
expect 3 '^error: frame 2: .*out.0002.ply' "$program" compare 'in.####.vdb' --meshes 'out.####.ply'
expect 1 '^error: frame 2: ' "$program" compare 'in.####.vdb' --frames 2 --meshes 'out.####.ply'
exit $((failures > 0))
