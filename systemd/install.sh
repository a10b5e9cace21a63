#!/bin/sh
# Installs the daemon as a service. Run it again after an update or a change of the tray file.
# An existing tray file and existing logs are not changed.
#
#   sudo systemd/install.sh                   # from a checkout, with the internet
#   sudo systemd/install.sh --wheels FOLDER   # without: from a folder of wheels (see README.md)
#   sudo systemd/install.sh --tray            # after a change of the tray file: nothing is installed
#   DESTDIR=/tmp/root DAQ=.venv/bin/daq systemd/install.sh   # install only the files into another root, using another daq
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=${DESTDIR:-}
prefix=/opt/flightpower
units=$root/etc/systemd/system

usage() {
    echo "install.sh: $1; usage: install.sh [--tray | --wheels FOLDER]" >&2
    exit 2
}
install_program=yes
wheels=
case "${1:-}" in
"") [ $# -eq 0 ] || usage "an empty argument" ;;
--tray) [ $# -eq 1 ] || usage "--tray takes no folder"; install_program=no ;;
--wheels)
    [ $# -eq 2 ] || usage "--wheels takes one folder"
    ls "$2"/flightpower-*.whl >/dev/null 2>&1 || usage "$2: has no wheel of flightpower"
    wheels=$2
    ;;
*) usage "unknown option $1" ;;
esac

if [ -z "$root" ] && [ "$(id -u)" -ne 0 ]; then
    echo "install.sh: must be run as root: sudo $0" >&2
    exit 1
fi

daq=${DAQ:-$prefix/bin/daq}
if [ -z "$root" ] && [ $install_program = yes ]; then
    [ -x $prefix/bin/python ] || python3 -m venv $prefix
    if [ -n "$wheels" ]; then
        # --force-reinstall: a newer wheel may have the same version number. Its dependencies stay if they suffice.
        $prefix/bin/pip install --quiet --no-index --find-links "$wheels" --upgrade flightpower
        $prefix/bin/pip install --quiet --no-index --find-links "$wheels" --no-deps --force-reinstall flightpower
    else
        $prefix/bin/pip install --quiet --upgrade "$(dirname "$here")"
    fi
    # Remove 100 MB that the daemon never loads: the other dialects of MAVLink, zstandard's second implementation, the
    # parser of pymavlink's generator, and setuptools.
    packages=$(echo $prefix/lib/python3*/site-packages)
    find "$packages/pymavlink/dialects" -type f ! -name __init__.py ! -path '*/v20/ardupilotmega*' -delete
    find "$packages/zstandard" "$packages/lxml" -type f \( -name '_cffi*.so' -o -path '*/lxml/*.so' \) -delete
    $prefix/bin/pip uninstall -qq --yes setuptools
fi
if ! [ -x "$daq" ]; then
    echo "install.sh: $daq is missing: run it once without --tray" >&2
    exit 1
fi

# An error in the tray file, or in a file that it names, is reported before the service is stopped.
if [ $install_program = no ] && [ -e "$root/etc/flightpower/tray.toml" ]; then
    "$daq" config --check "$root/etc/flightpower/tray.toml" >/dev/null
fi

install -D -m 0644 "$here/flightpower-daq.service" "$units/flightpower-daq.service"
install -D -m 0644 "$here/flightpower-status.service" "$units/flightpower-status.service" # not enabled
install -D -m 0644 "$here/60-flightpower.rules" "$root/etc/udev/rules.d/60-flightpower.rules"
install -D -m 0644 "$here/flightpower.sysusers" "$root/usr/lib/sysusers.d/flightpower.conf"
AGAIN="install.sh --tray" DAQ=$daq sh "$here/tray.sh" --files-only

if [ -z "$root" ]; then
    systemd-sysusers
    udevadm control --reload && udevadm trigger --subsystem-match=i2c-dev --subsystem-match=tty
    systemctl daemon-reload
    systemctl enable flightpower-daq.service
    systemctl restart --no-block flightpower-daq.service
    echo "install.sh: the service was started; see: systemctl status flightpower-daq"
fi
