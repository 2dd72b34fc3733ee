#!/usr/bin/env bash
# Prints the README's table: generated sequences, meshed by isotrack with and without --fit and by volumeToMesh at adaptivity 0 and 0.1.
# usage: table.sh PROGRAM [SHAPE...]
set -euo pipefail
program=$1
shift
shapes=("$@")
[ ${#shapes[@]} -gt 0 ] || shapes=(sphere torus shell plate box blobs enright)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

echo "| sequence | method | triangles | largest error | RMS error | smallest angle | 1 % of angles | crossing pairs | topology | time |"
echo "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|"
for shape in "${shapes[@]}"; do
    "$program" -q generate "$shape" -o "$work/$shape.####.vdb" --frames 12
    "$program" -q compare "$work/$shape.####.vdb" --csv >"$work/plain.csv" || [ $? -eq 3 ]
    "$program" -q compare "$work/$shape.####.vdb" --csv --fit | sed -n 's/,isotrack,/,isotrack --fit,/p' >"$work/fit.csv"
    # Topology: frames with the components and Euler number of volumeToMesh at adaptivity 0. Time: mean per frame over volumeToMesh 0.
    cat "$work/plain.csv" "$work/fit.csv" | LC_ALL=C awk -F, -v shape="$shape" '
        NR == 1 { for (i = 1; i <= NF; i++) column[$i] = i; next }
        {
            m = $2; n[m]++
            triangles[m] += $column["triangles"]; seconds[m] += $column["seconds"]; crossing[m] += $column["self_intersections"]
            e = $column["to_max_vx"] > $column["from_max_vx"] ? $column["to_max_vx"] : $column["from_max_vx"]
            if (e > error[m]) error[m] = e
            r = $column["to_rms_vx"] > $column["from_rms_vx"] ? $column["to_rms_vx"] : $column["from_rms_vx"]
            rms[m] += r
            a = $column["min_angle_deg"]; if (!(m in angle) || a < angle[m]) angle[m] = a
            p1[m] += $column["angle_p1_deg"]
            kind[m, $1] = $column["components"] " " $column["euler"]; frame[$1] = 1
        }
        END {
            split("isotrack;isotrack --fit;volumeToMesh 0;volumeToMesh 0.1", order, ";")
            for (i = 1; i <= 4; i++) {
                m = order[i]; if (!n[m]) continue
                same = 0; for (f in frame) same += kind[m, f] == kind["volumeToMesh 0", f]
                printf "| %s | %s | %d | %.2f | %.3f | %.1f | %.1f | %d | %d/%d | %.1f |\n", shape, m, triangles[m] / n[m], error[m], rms[m] / n[m],
                       angle[m], p1[m] / n[m], crossing[m], same, n[m], seconds[m] / seconds["volumeToMesh 0"] * n["volumeToMesh 0"] / n[m]
            }
        }'
done
