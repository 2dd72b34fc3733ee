#!/usr/bin/env bash
# Prints a table of isotrack beside its peers, and below it the shapes where a wanted figure is missed.
# usage: quality.sh PROGRAM_DIR [DATA...]
# PROGRAM_DIR holds isotrack and isotrack_peers. DATA: .vdb files, each a shape of its own, met cold; or sequences (folders or quoted
# patterns), of which the last three frames are measured, warm. Without DATA: twelve frames of each of the generated shapes.
# A cell with two numbers is isotrack and isotrack --fit.
set -euo pipefail
programs=$1
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ $# -eq 0 ]; then
    for shape in sphere torus shell plate box blobs enright; do
        "$programs/isotrack" -q generate "$shape" -o "$work/$shape/$shape.####.vdb" --frames 12
        set -- "$@" "$work/$shape"
    done
fi

echo "| shape | triangles | over make_surface_mesh's | largest error | RMS error | RMS over decimation's | smallest angle | 1 % of angles | crossing pairs | components and Euler number | time over volumeToMesh's | over make_surface_mesh's |"
echo "|---|---:|---:|---:|---:|---:|---:|---:|---:|---|---:|---:|"
for data in "$@"; do
    name=$(basename "$data" .vdb)
    measure=3
    [ ! -f "$data" ] || measure=1
    code=0
    "$programs/isotrack_peers" "$data" --measure "$measure" --no-remeshing --csv >"$work/rows.csv" || code=$?
    if [ "$code" -ne 0 ] && [ "$code" -ne 3 ]; then
        echo "- ${name//[.#]*/}: not measured" >>"$work/missed"
        continue
    fi
    # Means over the frames, but the worst of them for errors and angles and the sum for pairs.
    LC_ALL=C awk -F, -v shape="${name//[.#]*/}" -v missed="$work/missed" -v cold="$([ "$measure" -ne 1 ] || echo "$work/cold")" '
        NR == 1 { for (i = 1; i <= NF; i++) column[$i] = i; next }
        {
            m = $2; n[m]++
            triangles[m] += $column["triangles"]; seconds[m] += $column["seconds"]; pairs[m] += $column["self_intersections"]
            e = $column["to_max_vx"] > $column["from_max_vx"] ? $column["to_max_vx"] : $column["from_max_vx"]
            if (e > error[m]) error[m] = e
            rms[m] += $column["to_rms_vx"] > $column["from_rms_vx"] ? $column["to_rms_vx"] : $column["from_rms_vx"]
            if (n[m] == 1 || $column["min_angle_deg"] < least[m]) least[m] = $column["min_angle_deg"]
            if (n[m] == 1 || $column["angle_p1_deg"] < p1[m]) p1[m] = $column["angle_p1_deg"]
            kind[m, n[m]] = $column["components"] " " $column["euler"]
            unsound[m] += $column["closed"] != "true" || $column["manifold"] != "true"
            if ($column["triangles_over"] != "") { over[m] += $column["triangles_over"]; overs[m]++ }
            if ($column["rms_over"] != "") { rms_over += $column["rms_over"]; rms_overs++ }
        }
        function pair(format, a, b) { return sprintf(format " / " format, a, b) }
        function ratio(sum, count) { return count ? sprintf("%.2f", sum / count) : "-" }
        function topology(m,    i) { for (i = 1; i <= n[m]; i++) if (kind[m, i] != kind["volumeToMesh 0", i]) return "differ"; return "same" }
        function miss(bad, text) { if (bad) list = list (list == "" ? "" : ", ") text }
        END {
            a = "isotrack"; b = "isotrack --fit"; v = "volumeToMesh 0"
            sa = seconds["make_surface_mesh as " a]; sb = seconds["make_surface_mesh as " b]
            printf "| %s | %s | %s / %s | %s | %s | %s | %s | %s | %s | %s / %s | %s | %s / %s |\n", shape,
                   pair("%d", triangles[a] / n[a], triangles[b] / n[b]), ratio(over[a], overs[a]), ratio(over[b], overs[b]),
                   pair("%.3f", error[a], error[b]), pair("%.3f", rms[a] / n[a], rms[b] / n[b]), ratio(rms_over, rms_overs),
                   pair("%.1f", least[a], least[b]), pair("%.1f", p1[a], p1[b]), pair("%d", pairs[a], pairs[b]),
                   topology(a), topology(b), pair("%.0f", seconds[a] / seconds[v], seconds[b] / seconds[v]),
                   ratio(seconds[a], sa), ratio(seconds[b], sb)
            # Vertices are half the triangles, theirs as well.
            if (cold != "" && sa && overs[a]) print over[a] / overs[a] * sa / seconds[a], seconds[a] / sa >>cold
            for (k = 1; k <= 2; k++) {
                m = k == 1 ? a : b; list = ""
                miss(error[m] > 0.5, sprintf("error %.3f", error[m]))
                miss(least[m] < 15, sprintf("smallest angle %.1f", least[m]))
                miss(p1[m] < 30, sprintf("1 %% quantile %.1f", p1[m]))
                miss(pairs[m] > 0, sprintf("%d crossing pairs", pairs[m]))
                miss(unsound[m] > 0, "not closed or not manifold")
                miss(topology(m) != "same", sprintf("components and Euler number %s, volumeToMesh %s", kind[m, n[m]], kind[v, n[v]]))
                if (m == b) {
                    miss(!overs[m], "no make_surface_mesh of the same error"); miss(!rms_overs, "no decimation")
                    miss(overs[m] && over[m] / overs[m] > 0.85, "triangles over make_surface_mesh " ratio(over[m], overs[m]))
                    miss(rms_overs && rms_over / rms_overs > 1.15, "RMS over decimation " ratio(rms_over, rms_overs))
                }
                if (list != "") print "- " shape ", " m ": " list >>missed
            }
        }' "$work/rows.csv"
done
echo
echo "Measured on $(nproc) cores, $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)."
echo "Wanted: error at most 0.5 voxel; smallest angle at least 15 degrees, 1 % quantile at least 30; components and Euler number of volumeToMesh; no crossing pairs; with --fit at most 0.85 of make_surface_mesh's triangles at the same error, and an RMS error at most 1.15 of decimation's at the same count."
if [ -s "$work/cold" ]; then
    LC_ALL=C awk '
        function take(value, k) { if (NR == 1 || value < low[k]) low[k] = value; if (NR == 1 || value > high[k]) high[k] = value }
        { take($1, 1); take($2, 2) }
        END {
            printf "Shapes met cold: %.1f to %.1f times the vertices per second of make_surface_mesh at the same error; wanted: 5. ", low[1], high[1]
            printf "Their meshes, which have fewer vertices, take %.2f to %.2f of its time.\n", low[2], high[2]
        }' "$work/cold"
fi
if [ -s "$work/missed" ]; then
    echo "Missed:"
    cat "$work/missed"
else
    echo "Missed: nothing."
fi
