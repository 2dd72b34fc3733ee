#!/usr/bin/env bash
# isotrack generate, isotrack info and the border of isotrack mesh as a user runs them.
# usage: generate_and_info.sh PROGRAM DATA
data=$(cd "$2" && pwd)
. "$(dirname "${BASH_SOURCE[0]}")/support.sh"

# Every shape, two frames: listed by info, each with a surface that stays away from the border of its grid.
for shape in sphere ellipsoid torus plate shell box blobs birth enright splash; do
    voxel=0.05
    case $shape in plate | shell | enright) voxel=0.02 ;; esac  # thin ones
    expect 0 '' "$program" -q generate "$shape" -o "$shape/f.####.vdb" --frames 2 --voxel "$voxel"
    expect 0 "^ +2  surface +$voxel +[1-9][0-9]* +1 +[1-9][0-9]* +0 " "$program" info "$shape"
done
expect 0 '^\* surface +float +level set +0.05 ' "$program" info sphere/f.0001.vdb
expect 0 '^ +8  surface' "$program" info --frames 7:8 "$data/blobs"

# Existing files stay without --overwrite.
expect 0 '' "$program" -q generate torus -o 'again.####.vdb' --frames 2 --voxel 0.05
expect 2 'exists already' "$program" generate torus -o 'again.####.vdb' --frames 2
expect 0 '' "$program" -q generate torus -o 'again.####.vdb' --frames 1 --voxel 0.05 --overwrite

expect 2 "unknown shape 'cube', expected one of" "$program" generate cube -o 'c.####.vdb'
expect 2 'one file for 2 frames' "$program" generate sphere -o c.vdb --frames 2
expect 2 'voxel size must be from' "$program" generate sphere -o 'c.####.vdb' --voxel 3
expect 2 'must be a finite number, got nan' "$program" info --iso nan sphere/f.0001.vdb
expect 2 'must be a finite number, got -inf' "$program" mesh --iso -inf sphere/f.0001.vdb -o s.ply
expect 2 'not in range' "$program" --threads -3 info sphere/f.0001.vdb
expect 2 "no file or folder 'nothing.vdb'" "$program" info nothing.vdb
head -c 100 sphere/f.0001.vdb >half.vdb
expect 1 "^error: frame 0: cannot read 'half.vdb': .*cut off or damaged" "$program" info half.vdb
[ "$("$program" info half.vdb 2>&1 | wc -l)" -eq 1 ] || { echo 'more than a line on half.vdb'; failures=$((failures + 1)); }

# A closed surface has no border to open.
expect 0 '' "$program" -q mesh sphere -o 'closed.####.ply' --border close
expect 0 '' "$program" -q mesh sphere -o 'open.####.ply' --border open
expect 0 '' cmp closed.0002.ply open.0002.ply
expect 2 '' "$program" mesh sphere -o 'other.####.ply' --border ajar
exit $((failures > 0))
