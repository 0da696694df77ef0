# Sourced by the scripts beside it: makes .venv with the extras asked for, once.
# Usage: use_environment EXTRAS, such as "compare" or "compare,dev".

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
needed="Python 3.11 or newer with venv and pip"

# Small dense factorisations on several threads only wait for each other.
export OPENBLAS_NUM_THREADS=${OPENBLAS_NUM_THREADS:-1}

find_python() {
    local candidate
    for candidate in python3.11 python3.12 python3.13 python3 python; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    echo "$needed is missing. On Debian or Ubuntu: apt-get install python3 python3-venv" >&2
    return 1
}

use_environment() {
    local extras=$1 python stamp wanted
    stamp="$root/.venv/installed-$(echo "$extras" | tr ',' '-')"
    wanted=$(cat "$root/pyproject.toml" "$root/constraints.txt" | cksum)
    if [ -x "$root/.venv/bin/python" ] && [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ]; then
        return
    fi
    if ! "$root/.venv/bin/python" -c 'import pip' 2>/dev/null; then
        python=$(find_python) || return 1
        if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
            echo "$needed: $python has no venv or pip." >&2
            echo "On Debian or Ubuntu: apt-get install python3-venv python3-pip" >&2
            return 1
        fi
        echo "making .venv with $("$python" --version)" >&2
        "$python" -m venv --clear "$root/.venv" || return 1
    fi
    echo "installing jaxclay[$extras] into .venv (the first time only)" >&2
    "$root/.venv/bin/python" -m pip install --quiet --disable-pip-version-check \
        --constraint "$root/constraints.txt" --editable "$root[$extras]" || return 1
    echo "$wanted" >"$stamp"
}
