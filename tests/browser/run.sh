#!/usr/bin/env bash
# The page in a real browser against a real server; docs/TESTING.md says what is needed.
#   tests/browser/run.sh            skips, with a word, where browser or Node are missing
#   tests/browser/run.sh --require  fails there instead
# CULLMARK names the program to test, SHOTS a folder for pictures.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
playwright=1.57.0

require=no
[ "${1:-}" = --require ] && require=yes
skip() {
  if [ "$require" = yes ]; then
    echo "browser test: $1, and --require was given" >&2
    exit 1
  fi
  echo "browser test SKIPPED: $1"
  exit 0
}
install() {
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
  { apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"; } >/dev/null 2>&1
}

browser() { command -v chromium || command -v chromium-browser || command -v google-chrome || command -v google-chrome-stable; }
CHROMIUM=${CHROMIUM:-$(browser || { install chromium && browser; } || true)}
[ -n "$CHROMIUM" ] || skip "there is no Chromium, and apt-get could not install one"
modern() { command -v node >/dev/null && [ "$(node -p 'parseInt(process.versions.node)')" -ge 18 ]; }
modern || install nodejs npm || true
modern || skip "there is no Node 18 or newer, and apt-get could not install one"

# Outside the repository, and kept for the next time.
PLAYWRIGHT=${XDG_CACHE_HOME:-${HOME:-/tmp}/.cache}/cullmark-browser/playwright-core-$playwright
if ! [ -e "$PLAYWRIGHT/node_modules/playwright-core/package.json" ]; then
  command -v npm >/dev/null || skip "there is no npm to fetch playwright-core with"
  mkdir -p "$PLAYWRIGHT"
  npm install --prefix "$PLAYWRIGHT" --no-audit --no-fund --no-save --ignore-scripts --loglevel=error "playwright-core@$playwright" >/dev/null ||
    skip "npm could not fetch playwright-core $playwright"
fi

# What was built last is what is meant.
CULLMARK=${CULLMARK:-$(ls -t "$root"/target/{release,debug}/cullmark 2>/dev/null | head -1 || true)}
if [ -z "$CULLMARK" ]; then
  (cd "$root" && cargo build --locked --quiet)
  CULLMARK=$root/target/debug/cullmark
fi
CULLMARK=$(realpath "$CULLMARK")

BROWSER_TEMP=$(mktemp -d)
SHOTS=${SHOTS:-$(mktemp -d -t cullmark-shots-XXXXXX)}
trap 'rm -rf "$BROWSER_TEMP"' EXIT
export CHROMIUM PLAYWRIGHT CULLMARK BROWSER_TEMP SHOTS
node "$here/all.mjs"
