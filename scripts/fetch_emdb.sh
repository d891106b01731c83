#!/usr/bin/env bash
# Downloads maps of the Electron Microscopy Data Bank with their recommended contour levels.
set -euo pipefail

usage() {
  cat <<'END'
usage: scripts/fetch_emdb.sh [-o DIR] ID...

For each entry: DIR/emd_NNNN.map.gz, checked against its own header, and beside it DIR/emd_NNNN.json with id, title,
contour (the recommended isovalue, null where the entry has none), size, voxel_size_A, map, url and sha256.

  ID                1080, EMD-1080 or emd_1080; the word `paper` stands for 1048 1129 1265 1590 1617 5119
  -o DIR            where the files go (.); made where it is not there
  --retries N       how often a transfer that broke off is tried again (3)
  --archive URL     a mirror of the archive, tried in the order given, in place of
                    https://files.wwpdb.org/pub/emdb/structures and https://ftp.ebi.ac.uk/pub/databases/emdb/structures
  --api URL         where records are asked for, in place of https://www.ebi.ac.uk/emdb/api/entry

Every file appears whole or not at all. An entry that fails does not keep the others from being fetched.
Exit codes: 0 all done, 2 usage, 3 what came is damaged, 4 a download failed or a file could not be written (the
highest of several), 130 interrupted.
END
}

complain() { printf 'fetch_emdb.sh: error: %s\n' "$1" >&2; }
misused() { complain "$1; see --help"; exit 2; }

folder=. retries=3 archives=() api=https://www.ebi.ac.uk/emdb/api/entry ids=()
while [ $# -gt 0 ]; do
  case $1 in
    -h|--help) usage; exit 0 ;;
    -o|--retries|--archive|--api)
      [ $# -ge 2 ] && [ -n "$2" ] || misused "$1 needs a value"
      case $1 in
        -o) folder=$2 ;;
        --retries) [[ $2 =~ ^[0-9]{1,3}$ ]] || misused "--retries $2: expected a number"; retries=$2 ;;
        --archive) archives+=("${2%/}") ;;
        --api) api=${2%/} ;;
      esac
      shift ;;
    -*) misused "$1 is not an option" ;;
    paper) ids+=(1048 1129 1265 1590 1617 5119) ;;
    *)
      [[ $1 =~ ^([Ee][Mm][Dd][-_])?([0-9]{4,6})$ ]] || misused "$1 is not an EMDB entry: expected a number such as 1080"
      ids+=("${BASH_REMATCH[2]}") ;;
  esac
  shift
done
[ ${#ids[@]} -gt 0 ] || misused "no entry given"
if [ ${#archives[@]} -eq 0 ]; then
  archives=(https://files.wwpdb.org/pub/emdb/structures https://ftp.ebi.ac.uk/pub/databases/emdb/structures)
fi
for program in curl python3; do
  command -v "$program" >/dev/null || { complain "$program is not installed"; exit 4; }
done
here=$(cd "$(dirname "$0")/.." && pwd)
vdbgeo=$(command -v vdbgeo || true)
if [ -z "$vdbgeo" ] && [ -x "$here/build/release/bin/vdbgeo" ]; then vdbgeo=$here/build/release/bin/vdbgeo; fi
mkdir -p -- "$folder" || { complain "$folder: cannot be made"; exit 4; }

work=$(mktemp -d -- "$folder/.fetch_emdb.XXXXXX") || { complain "$folder: cannot be written"; exit 4; }
trap 'rm -rf -- "$work"' EXIT
trap 'exit 130' INT TERM

# get URL FILE: the file, or nothing and curl's exit code.
get() {
  curl --fail --silent --show-error --location --connect-timeout 30 --speed-limit 1 --speed-time 120 \
    --retry "$retries" --retry-connrefused --output "$2" --url "$1" 2>"$work/curl" || { rm -f -- "$2"; return 1; }
}

# read_map FILE: the header's size, voxel size and the file's sum, or one line that says what is wrong.
read_map() {
  python3 - "$1" <<'END'
import gzip, hashlib, json, math, struct, sys, zlib

def fail(text):
    print(text)
    sys.exit(3)

path = sys.argv[1]
try:
    with gzip.open(path) as file:
        header = file.read(1024)
        length = len(header)
        while part := file.read(1 << 24):
            length += len(part)
except (OSError, EOFError, zlib.error) as error:
    fail(f"not a whole gzip file: {error}")
if len(header) < 1024:
    fail(f"expected a header of 1024 bytes, found {len(header)}")
BYTES = {0: 1, 1: 2, 2: 4, 6: 2, 12: 2, 101: 0.5}
for order in "><":  # what is in neither order is told in the usual one
    words = struct.unpack(order + "256i", header)
    if min(words[:3]) > 0 and words[3] in BYTES and sorted(words[16:19]) in ([1, 2, 3], [0, 0, 0]):
        break
else:
    fail(f"not an MRC header: size {words[:3]}, mode {words[3]}")
nx, ny, nz, mode = words[:4]
expected = 1024 + max(words[23], 0) + math.ceil(nx * BYTES[mode]) * ny * nz
if length < expected:
    fail(f"truncated: expected {expected} bytes for {nx} x {ny} x {nz} samples of mode {mode}, found {length}")
cell = struct.unpack(order + "3f", header[40:52])
# Cell and sampling lie along x, y, z; columns, rows and sections need not.
voxel = [float(f"{c / m:.7g}") if m > 0 and math.isfinite(c) else None for c, m in zip(cell, words[7:10])]
with open(path, "rb") as file:
    digest = hashlib.sha256()
    while part := file.read(1 << 24):
        digest.update(part)
size = [n for _, n in sorted(zip(words[16:19], words[:3]), key=lambda pair: pair[0])]  # along x, y, z
print(json.dumps({"size": size, "voxel_size_A": voxel, "sha256": digest.hexdigest()}))
END
}

# read_record FILE: title and contour out of the record (JSON) or the header (XML).
read_record() {
  python3 - "$1" <<'END'
import json, math, sys
import xml.etree.ElementTree as tree

def number(value):
    try:
        value = float(value)
    except (TypeError, ValueError):
        return None
    return value if math.isfinite(value) else None

def primary_level(contours):  # pairs (primary, level)
    levels = [(str(primary).lower() == "true", number(level)) for primary, level in contours]
    levels = [pair for pair in levels if pair[1] is not None]
    return max(levels, key=lambda pair: pair[0])[1] if levels else None

def child(value, *names):
    for name in names:
        value = value.get(name) if isinstance(value, dict) else None
    return value

def from_json(entry):
    found = child(entry, "map", "contour_list", "contour")
    found = found if isinstance(found, list) else [found]
    contours = [(c.get("primary"), c.get("level")) for c in found if isinstance(c, dict)]
    return {"title": child(entry, "admin", "title"), "contour": primary_level(contours)}

def from_xml(root):
    def all_of(node, name):
        return [e for e in node.iter() if e.tag.rsplit("}", 1)[-1] == name]
    # Since 2016 <contour primary="true"><level>, before <contourLevel>.
    contours = [(c.get("primary"), level.text) for c in all_of(root, "contour") for level in all_of(c, "level")]
    contours += [("false", c.text) for c in all_of(root, "contourLevel")]
    title = next((e.text for e in all_of(root, "title") if e.text), None)
    return {"title": title, "contour": primary_level(contours)}

data = open(sys.argv[1], "rb").read()
try:
    record = from_json(json.loads(data))
except ValueError:
    try:
        record = from_xml(tree.fromstring(data))
    except tree.ParseError:
        print("the record is neither JSON nor XML")
        sys.exit(3)
print(json.dumps(record))
END
}

# fetch_map NUMBER: $work/map.gz, $work/map.json and $work/url.
fetch_map() {
  local archive url code=4
  for archive in "${archives[@]}"; do
    url=$archive/EMD-$1/map/emd_$1.map.gz
    if ! get "$url" "$work/map.gz"; then
      complain "EMD-$1: $url: $(tail -n 1 "$work/curl")"
    elif ! read_map "$work/map.gz" >"$work/map.json"; then
      complain "EMD-$1: $url: $(cat "$work/map.json")" && code=3
    elif [ -n "$vdbgeo" ] && ! "$vdbgeo" info "$work/map.gz" --quiet >/dev/null 2>"$work/info"; then
      complain "EMD-$1: $url: $(tail -n 1 "$work/info")" && code=3
    else
      printf '%s' "$url" >"$work/url"
      return 0
    fi
  done
  return $code
}

# fetch_record NUMBER: $work/record.json, from the first source that has a contour, else the first that answers.
fetch_record() {
  local url code=4 answered=
  for url in "$api/EMD-$1" "${archives[@]/%//EMD-$1/header/emd-$1.xml}"; do
    if ! get "$url" "$work/record"; then
      continue
    elif ! read_record "$work/record" >"$work/read"; then
      complain "EMD-$1: $url: $(cat "$work/read")" && code=3
      continue
    fi
    if [ -z "$answered" ]; then cp -- "$work/read" "$work/record.json" && answered=yes; fi
    if ! grep -q '"contour": null' "$work/read"; then
      cp -- "$work/read" "$work/record.json"
      return 0
    fi
  done
  if [ -n "$answered" ]; then
    printf 'fetch_emdb.sh: EMD-%s has no recommended contour\n' "$1" >&2
    return 0
  fi
  complain "EMD-$1: no record from $api or a header from the archive"
  return $code
}

write_json() {
  python3 - "$1" "$work" <<'END'
import json, pathlib, sys
number, work = sys.argv[1], pathlib.Path(sys.argv[2])
record, measured = (json.loads((work / f"{name}.json").read_text()) for name in ("record", "map"))
text = json.dumps({"id": f"EMD-{number}", "title": record["title"], "contour": record["contour"],
                   "size": measured["size"], "voxel_size_A": measured["voxel_size_A"],
                   "map": f"emd_{number}.map.gz", "url": (work / "url").read_text(), "sha256": measured["sha256"]},
                  indent=2, ensure_ascii=False)
(work / "entry.json").write_text(text + "\n", encoding="utf-8")
END
}

# The record goes last: where it is, the map is whole.
fetch() {
  fetch_map "$1" || return
  fetch_record "$1" || return
  if write_json "$1" && rm -f -- "$folder/emd_$1.json" && mv -f -- "$work/map.gz" "$folder/emd_$1.map.gz" &&
    mv -f -- "$work/entry.json" "$folder/emd_$1.json"; then
    return 0
  fi
  complain "EMD-$1: $folder: cannot be written"
  return 4
}

worst=0 failed=()
for id in "${ids[@]}"; do
  rm -rf -- "${work:?}"/*
  code=0
  fetch "$id" || code=$?
  if [ "$code" -eq 0 ]; then
    printf '%s\n' "$folder/emd_$id.map.gz"
  else
    failed+=("EMD-$id")
    if [ "$code" -gt "$worst" ]; then worst=$code; fi
  fi
done
if [ ${#failed[@]} -gt 0 ]; then complain "${#failed[@]} of ${#ids[@]} entries failed: ${failed[*]}"; fi
exit "$worst"
