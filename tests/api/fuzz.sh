#!/usr/bin/env bash
# Fuzzes the HTTP API from its own OpenAPI document: no 5xx, no hang, no answer that the
# document does not describe. Usage: tests/api/fuzz.sh [seconds]
# Needs python3 (installs schemathesis into a folder of its own) and a binary:
# $CULLMARK, or target/release/cullmark, or target/debug/cullmark.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-120}
binary=${CULLMARK:-}
for candidate in target/release/cullmark target/debug/cullmark; do
  [ -n "$binary" ] || { [ -x "$candidate" ] && binary=$candidate; }
done
[ -n "$binary" ] || { echo "no binary: cargo build --release, or set CULLMARK" >&2; exit 1; }
binary=$(realpath "$binary")
if ! command -v python3 >/dev/null; then
  echo "skipped: python3 is needed to fuzz the API"
  exit 0
fi
work=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
tools=${SCHEMATHESIS_VENV:-$work/venv}
if [ ! -x "$tools/bin/schemathesis" ]; then
  python3 -m venv "$tools" && "$tools/bin/pip" install -q "schemathesis==4.32.5" || { echo "skipped: schemathesis cannot be installed"; exit 0; }
fi

CULLMARK_LANE=$work/lane "$binary" serve --listen 127.0.0.1:0 --db "$work/x.db" --rate 0 >"$work/address" 2>"$work/log" &
server=$!
for _ in $(seq 100); do grep -q listening "$work/address" && break; sleep 0.1; done
base=$(sed -n 's/listening on //p' "$work/address")
[ -n "$base" ] || { cat "$work/log" >&2; exit 1; }
"$binary" submit experiments/tiny.toml --server "$base" --watch
"$binary" submit experiments/tiny.toml --server "$base" --series next --watch

# Names of things that are there beside some that are not: random text alone finds nothing.
python3 - "$base" "$work/openapi.json" <<'PYTHON'
import json, sys, urllib.request
base, out = sys.argv[1:]
get = lambda path: json.load(urllib.request.urlopen(base + "/api/v1" + path))
doc = get("/openapi.json")
run = get("/studies/tiny@0/runs?limit=1")["items"][0]["run"]
charts = [c["id"] + s for c in get("/studies/tiny@0/charts")["items"][:4] for s in (".svg", ".png")]
known = {"study": ["tiny@0", "tiny@1", "tiny", "nothing"], "first": ["tiny@0", "nothing"], "second": ["tiny@1", "tiny"],
         "run": ["0", "3", run, "99"], "chart": charts + ["x.svg", "x"], "frame": [0, 5, 1000000], "id": ["0" * 32]}
for path, operations in doc["paths"].items():
    for operation in operations.values():
        for parameter in operation.get("parameters", []):
            if parameter["name"] in known:
                parameter["schema"] = {"enum": known[parameter["name"]]}
# A stream never ends: tests/it/service reads it.
del doc["paths"]["/studies/{study}/events"]
json.dump(doc, open(out, "w"))
PYTHON

cd "$work"
"$tools/bin/schemathesis" run openapi.json -u "$base/api/v1" --phases examples,coverage,fuzzing \
  --checks not_a_server_error,status_code_conformance,content_type_conformance,response_schema_conformance \
  --request-timeout 30 --continue-on-failure --max-time "$seconds" --seed "${SEED:-1}" --warnings off
curl -sf "$base/healthz" >/dev/null 2>&1 || python3 -c "import urllib.request; urllib.request.urlopen('$base/healthz')"
! grep -E "panic|made a mistake" "$work/log" || { echo "the server's log holds a mistake of its own" >&2; exit 1; }
echo "the API held"
