#!/bin/sh
# Makes report pages of all sorts for the browser: make_pages.sh VDBGEO FOLDER
#   model.html    of a real map (VDBGEO_DATA), else of a phantom
#   bare.html     without pockets
#   dust.html     a surface in ten thousand pieces
#   aborted.html  a run that was broken off: no summary, half of the files
set -eu
vdbgeo=$1 out=$2
rm -rf "$out" && mkdir -p "$out" && cd "$out"
model() { "$vdbgeo" model "$@" --quiet --width 600 --occlusion 1 >/dev/null; }

map=${VDBGEO_DATA:-}/multifit_groel/groel-11.5A.mrc iso=0.8
if [ ! -f "$map" ]; then
  map=$out/map.mrc iso=0.5
  "$vdbgeo" phantom atpase "$map" --size 80 --snr 20 --quiet >/dev/null
fi
model "$map" -o model --iso "$iso"

"$vdbgeo" phantom atpase bare.mrc --size 64 --quiet >/dev/null
model bare.mrc -o bare --iso 0.5 --set pockets.min-area=1e9

"$vdbgeo" phantom atpase noise.mrc --size 96 --snr 0.02 --seed 1 --quiet >/dev/null
model noise.mrc -o dust --iso 2.3sigma --skip denoise --skip tets

mkdir aborted
cp model/density.vdb model/smooth.vdb model/surface.ply model/slices_* model/density.svg aborted/
"$vdbgeo" report aborted --quiet >/dev/null

for page in model bare dust aborted; do mv "$page/report.html" "$page.html"; done
