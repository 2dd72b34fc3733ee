#!/usr/bin/env bash
# Prints what a warm frame costs as the grid grows, with one thread and two, and as the mesh grows, and below each table the wanted
# figures that are missed. The surface is a sphere with bumps that travel; a warm frame is the mean of the last two of four in
# the first table, of the last six of eight in the others. Threads are compared by the medians of three runs.
# usage: scale.sh PROGRAM_DIR [--large] [VOXELS_PER_DIAGONAL...]
#        scale.sh PROGRAM_DIR --long
# PROGRAM_DIR holds isotrack_scale. --large adds the row of 500 000 particles. Without VOXELS_PER_DIAGONAL: 256 512 1024 2048.
# --long prints instead of all that what memory a run takes, from few frames to 200.
set -euo pipefail
program=$1/isotrack_scale
shift
option=
case ${1-} in
--large | --long)
    option=$1
    shift
    ;;
esac
[ $# -gt 0 ] || set -- 256 512 1024 2048
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# write SIZE...: frames to measure on, and their voxel size in $voxel.
write() {
    rm -rf "$work/frames"
    voxel=$("$program" write "$work/frames" "$@")
}
# track OPTION...: names and values of the last frames into row.csv.
track() {
    "$program" track "$work/frames" "$@" >"$work/row.csv"
}
track_six() {
    track "$@" --measure 6
}
# run_files [OPTION...]: names and values of a run from files to files.
run_files() {
    "$program" files "$work/frames" --tolerance "$tolerance" "$@"
}
calculate() {
    LC_ALL=C awk "BEGIN { print $1 }"
}
# evaluate [AWK_OPTION...] PROGRAM: the program finds the values of row.csv in value[name], those of its second row in second[name].
evaluate() {
    local program_text="${!#}"
    LC_ALL=C awk -F, -v missed="$work/missed" "${@:1:$#-1}" '
        function miss(bad, text) { if (bad) print "- " text >>missed }
        NR == 1 { for (i = 1; i <= NF; i++) name[i] = $i }
        NR == 2 { for (i = 1; i <= NF; i++) value[name[i]] = $i }
        NR == 3 { for (i = 1; i <= NF; i++) second[name[i]] = $i }
        '"$program_text" "$work/row.csv"
}
# medians ROW_CSV...: of an odd number of files with the same names, as such a file.
medians() {
    LC_ALL=C awk -F, '
        FNR == 1 { if (NR == 1) print; next }
        { ++rows; for (i = 1; i <= NF; i++) value[i, rows] = $i + 0 }
        END {
            for (i = 1; i <= NF; i++)
                for (row = 1; row <= rows; row++) {
                    below = same = 0
                    for (other = 1; other <= rows; other++) {
                        below += (value[i, other] < value[i, row])
                        same += (value[i, other] == value[i, row])
                    }
                    if (below <= (rows - 1) / 2 && below + same > (rows - 1) / 2) {
                        printf "%s%.9g", (i > 1 ? "," : ""), value[i, row]
                        break
                    }
                }
            print ""
        }' "$@"
}
print_missed() {
    if [ -s "$work/missed" ]; then
        echo "Missed:"
        cat "$work/missed"
    else
        echo "Missed: nothing."
    fi
    : >"$work/missed"
}

# size_for PARTICLES [OPTION...]. Of this surface: particles times tolerance, and the voxel that leaves two of them between neighbours.
size_for() {
    tolerance=$(calculate "11.5 / $1")
    write --voxel "$(calculate "0.55 / sqrt($1)")" "${@:2}"
}
print_machine() {
    echo "Measured on $(nproc) cores, $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)."
}

if [ "$option" = --long ]; then
    echo "Peak memory of runs from files to files above the program and two grids, bytes per particle."
    echo
    echo "| frames | particles | bytes per particle | with --fit: particles | bytes per particle |"
    echo "|---:|---:|---:|---:|---:|"
    for frames in 8 50 200; do
        size_for 16000 --frames "$frames"
        run_files >"$work/row.csv"
        run_files --fit | sed 1d >>"$work/row.csv"
        evaluate -v frames="$frames" '
            END {
                bytes = 1048576 * value["above_mb"] / value["particles"]
                fitted_bytes = 1048576 * second["above_mb"] / second["particles"]
                printf "| %d | %d | %d | %d | %d |\n", frames, value["particles"], bytes, second["particles"], fitted_bytes
                miss(bytes > 1500, sprintf("%d frames: %d bytes per particle", frames, bytes))
                miss(fitted_bytes > 1500, sprintf("%d frames with --fit: %d bytes per particle", frames, fitted_bytes))
            }'
    done
    echo
    echo "Wanted: at most 1500."
    print_missed
    echo
    print_machine
    exit
fi

echo "Resolution, at the same tolerance in world units, half a voxel of 256 per diagonal; seconds. Reading a file, which volumeToMesh would have to do as well, is not in the total."
echo
echo "| voxels per diagonal | active voxels | particles | read | open | cover | other stages | total | volumeToMesh, adaptivity 0.1 | 0 | total over 0.1 | over 0 | carry and cover, ns per active voxel |"
echo "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
write --per-diagonal 256 --frames 1
tolerance=$(calculate "0.5 * $voxel")
for size in "$@"; do
    write --per-diagonal "$size"
    track --tolerance "$tolerance" --peers
    least=$(cat "$work/least" 2>/dev/null || true)
    evaluate -v size="$size" -v least="$least" -v least_file="$work/least" '
        END {
            total = value["open"] + value["advance"]; others = value["advance"] - value["cover"]
            nanoseconds = 1e9 * (value["carry"] + value["cover"]) / value["voxels"]
            printf "| %d | %d | %d | %.3f | %.3f | %.3f | %.3f | %.3f | %.3f | %.3f | %.2f | %.2f | %.0f |\n", size, value["voxels"],
                   value["particles"], value["read"], value["open"], value["cover"], others, total, value["adaptive"], value["uniform"],
                   total / value["adaptive"], total / value["uniform"], nanoseconds
            miss(value["not_kept"] > 0, size ": tolerance not kept")
            miss(nanoseconds > 30, sprintf("%d: carry and cover %.0f ns per active voxel", size, nanoseconds))
            if (least == "") print others >least_file
            else miss(others > 1.1 * least, sprintf("%d: other stages take %.1f times what they take at the first size", size, others / least))
            miss(size == 1024 && total > value["adaptive"], sprintf("%d: %.2f of volumeToMesh at adaptivity 0.1", size, total / value["adaptive"]))
            miss(size == 2048 && total > value["uniform"], sprintf("%d: %.2f of volumeToMesh at adaptivity 0", size, total / value["uniform"]))
        }'
done
echo
echo "The crossings that are covered are found beside the carry, which takes longer for it: it is among the other stages. Wanted: carry and cover together at most 30 ns per active voxel; the time of the other stages does not grow (by no more than a tenth); the total below volumeToMesh's at adaptivity 0.1 from 1024 on, at adaptivity 0 from 2048 on."
print_missed

echo
size_for 25000 --frames 8
for round in 1 2 3; do  # in turns, as the machine may be slower in some minutes
    for threads in 1 2; do
        track_six --tolerance "$tolerance" --threads "$threads"
        cp "$work/row.csv" "$work/$threads.$round.csv"
    done
done
medians "$work"/2.*.csv >"$work/row.csv"
medians "$work"/1.*.csv | sed 1d >>"$work/row.csv"
evaluate '
    function row(text, key,    times) {
        if (!(key in second) || !(value[key] > 0)) return
        times = second[key] / value[key]
        printf "| %s | %.3f | %.3f | %.2f |\n", text, second[key], value[key], times
        miss((key == "relax" || key == "certify" || key == "both") && times < 1.6, sprintf("%s %.2f", text, times))
    }
    END {
        printf "Threads, on %d particles; seconds, medians of three runs each.\n\n| stage | 1 thread | 2 threads | speed-up |\n|---|---:|---:|---:|\n", value["particles"]
        value["both"] = value["carry"] + value["cover"]; second["both"] = second["carry"] + second["cover"]
        row("open", "open")
        row("carry and cover", "both")
        count = split("size relax delaunay convect fit certify blunt", stages, " ")
        for (i = 1; i <= count; i++) row(stages[i], stages[i])
        row("all but open", "advance")
    }'
echo
echo "Wanted: a speed-up of 1.6 in relax, certify, and carry and cover, which run beside each other."
print_missed

echo
echo "Size, at about the same number of voxels between particles."
echo
echo "| particles | active voxels | tolerance, voxels | seconds, without read | particles per second | peak memory above the grid and the program, bytes per particle | of a run from files to files, above two grids | with --fit: particles | seconds | of these the fit | particles per second | bytes per particle | of a run |"
echo "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
sizes="5000 16000 50000 160000"
[ "$option" != --large ] || sizes="$sizes 500000"
for size in $sizes; do
    size_for "$size" --frames 8
    track_six --tolerance "$tolerance"
    cp "$work/row.csv" "$work/plain.csv"
    track_six --tolerance "$tolerance" --fit  # rows of other columns
    cp "$work/row.csv" "$work/fitted.csv"
    run_files >"$work/run.csv"
    run_files --fit >"$work/fitted_run.csv"
    cat "$work/plain.csv" "$work/fitted.csv" "$work/run.csv" "$work/fitted_run.csv" >"$work/row.csv"
    evaluate -v tolerance="$(calculate "$tolerance / $voxel")" '
        NR == 3 { for (i = 1; i <= NF; i++) fitted_name[i] = $i }
        NR == 4 { for (i = 1; i <= NF; i++) fitted[fitted_name[i]] = $i }
        NR == 5 { for (i = 1; i <= NF; i++) run_name[i] = $i }
        NR == 6 { for (i = 1; i <= NF; i++) run[run_name[i]] = $i }
        NR == 8 { for (i = 1; i <= NF; i++) fitted_run[run_name[i]] = $i }
        function bytes_of(values) { return 1048576 * values["above_mb"] / values["particles"] }
        END {
            rate = value["particles"] / value["advance"]; fitted_rate = fitted["particles"] / fitted["advance"]
            bytes = bytes_of(value); fitted_bytes = bytes_of(fitted); run_bytes = bytes_of(run); fitted_run_bytes = bytes_of(fitted_run)
            printf "| %d | %d | %.2f | %.2f | %d | %d | %d | %d | %.2f | %.2f | %d | %d | %d |\n", value["particles"], value["voxels"],
                   tolerance, value["advance"], rate, bytes, run_bytes, fitted["particles"], fitted["advance"], fitted["fit"], fitted_rate,
                   fitted_bytes, fitted_run_bytes
            miss(value["not_kept"] + fitted["not_kept"] > 0, sprintf("%d particles: tolerance not kept", value["particles"]))
            miss(rate < 60000, sprintf("%d particles: %d per second", value["particles"], rate))
            miss(fitted_rate < 60000, sprintf("%d particles with --fit: %d per second", fitted["particles"], fitted_rate))
            miss(bytes > 1500, sprintf("%d particles: %d bytes each", value["particles"], bytes))
            miss(fitted_bytes > 1500, sprintf("%d particles with --fit: %d bytes each", fitted["particles"], fitted_bytes))
            miss(run["not_kept"] + fitted_run["not_kept"] > 0, sprintf("runs with %d and %d particles: frames not ok", run["particles"], fitted_run["particles"]))
            miss(run_bytes > 1500, sprintf("a run with %d particles: %d bytes each", run["particles"], run_bytes))
            miss(fitted_run_bytes > 1500, sprintf("a run with %d particles with --fit: %d bytes each", fitted_run["particles"], fitted_run_bytes))
        }'
done
echo
echo "Wanted: 60 000 particles per second, at most 1500 bytes each."
print_missed

# A body whose DT is the hardest for the exact predicates, beside the one with bumps, of about as many particles.
echo
echo "| surface | particles | seconds, without read | microseconds per particle | of these the DT |"
echo "|---|---:|---:|---:|---:|"
sphere_row() {
    evaluate -v surface="$1" '
        END {
            printf "| %s | %d | %.2f | %.1f | %.1f |\n", surface, value["particles"], value["advance"],
                   1e6 * value["advance"] / value["particles"], 1e6 * value["delaunay"] / value["particles"]
        }'
}
size_for 16000 --frames 8
track_six --tolerance "$tolerance"
sphere_row "sphere with bumps"
write --voxel "$voxel" --perfect --frames 8
track_six --tolerance "$(calculate "$tolerance / 8.4")"
sphere_row "perfect sphere"

echo
size_for 16000 --frames 12
run_files >"$work/row.csv"
evaluate '
    END {
        slowest = value["tracking"]
        if (value["reading"] > slowest) slowest = value["reading"]
        if (value["finishing"] > slowest) slowest = value["finishing"]
        printf "From files to files, %d frames of %d particles: %.2f s; reading takes %.2f s of it, tracking %.2f, finishing and writing %.2f, beside each other: %.2f of the slowest.\n",
               value["frames"], value["particles"], value["all"], value["reading"], value["tracking"], value["finishing"], value["all"] / slowest
        miss(value["all"] / slowest > 1.15, sprintf("from files to files %.2f of the slowest stage", value["all"] / slowest))
    }'
echo
echo "Wanted: at most 1.15 of the slowest."
print_missed
echo
print_machine
