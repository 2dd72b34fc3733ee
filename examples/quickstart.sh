#!/usr/bin/env bash
# From a fresh clone to meshes: installs what is missing, builds the program, meshes the sample sequence and says what came out.
. "$(dirname "${BASH_SOURCE[0]}")/../tests/bootstrap.sh"

{
    install_packages
    configure
    cmake --build "$project/build" --parallel "$jobs" --target isotrack_program
} >&2

cd "$project"
rm -f out/quickstart/run.json
status=0
build/isotrack mesh 'data/blobs/blobs.####.vdb' -o out/quickstart/blobs.####.ply \
    --report out/quickstart/run.json --overwrite || status=$?
[ -s out/quickstart/run.json ] || exit "$status"

# One field of run.json per record: numbers and words are all this needs, so braces and commas inside messages do no harm.
echo
echo "Meshes:    $project/out/quickstart/blobs.####.ply"
echo "Report:    $project/out/quickstart/run.json"
LC_ALL=C awk -v RS='[][{},]' '
    { key = $0; sub(/^[^"]*"/, "", key); sub(/".*/, "", key); value = $0; sub(/^[^:]*:[ \t\n]*/, "", value); value += 0 }
    key == "triangles"    { if (!frames++ || value < least) least = value; if (value > most) most = value }
    key == "max_error_vx" { if (value > error) error = value; if (/null/) endless = 1 }
    key == "total"        { seconds += value }
    key == "closed"       { closed += /: *true/ }
    key == "manifold"     { manifold += /: *true/ }
    END {
        printf "Frames:    %d, each of %d to %d triangles, in %.1f seconds\n", frames, least, most, seconds
        if (endless) print "Error:     not finite in some frame: a part of the level set has no mesh"
        else printf "Error:     at most %.2f voxels between mesh and level set, measured both ways\n", error
        printf "Closed:    %d of %d meshes; manifold: %d of %d\n", closed, frames, manifold, frames
    }' out/quickstart/run.json
exit "$status"
