#!/usr/bin/env bash
# Installs Chromium and its driver for the tests of the studio's page, where that can be done: on
# Debian, as root.  Elsewhere these tests are skipped with a reason, and nothing else changes.
set -euo pipefail

if command -v chromium >/dev/null && command -v chromedriver >/dev/null; then
    exit 0
fi

without() {
    echo "note: the tests of the studio's page are skipped: $*" >&2
    exit 0
}

# Ubuntu's package of this name is a snap, which does not run in containers.
grep -qsx 'ID=debian' /etc/os-release || without "they need chromium and chromedriver"
[[ $(id -u) == 0 ]] || without "they need Debian's packages chromium and chromium-driver"
echo "setup: installing Debian's chromium and chromium-driver for the tests of the studio's page, once"
quiet=(-qq -o=Dpkg::Use-Pty=0 -o=Acquire::Retries=2 -o=Acquire::http::Timeout=20)
export DEBIAN_FRONTEND=noninteractive
{
    timeout 120 apt-get update "${quiet[@]}" &&
        timeout 600 apt-get install -y --no-install-recommends "${quiet[@]}" chromium chromium-driver
} >/dev/null 2>&1 || without "apt-get could not install chromium and chromium-driver"
