#!/bin/sh
# Part of install.sh, and in the Debian package the command flightpower-tray.
set -eu

root=${DESTDIR:-}
daq=${DAQ:-/usr/bin/daq}
tray=$root/etc/flightpower/tray.toml
dropin=$root/etc/systemd/system/flightpower-daq.service.d
restart=yes

case "${1:-}" in
"") ;;
--files-only) restart=no ;;
--help)
    cat <<EOF
Usage: flightpower-tray [OPTION]

  Permits the service flightpower-daq the devices of $tray, and starts it with that file. Run this as
  root after each change of the file. If there is none, the example is installed.

Options:
  --files-only  Do not start the service.
  --help        Show this message and exit.
EOF
    exit 0
    ;;
*)
    echo "flightpower-tray: unknown option $1; usage: flightpower-tray [--files-only]" >&2
    exit 2
    ;;
esac

if [ -z "$root" ] && [ "$(id -u)" -ne 0 ]; then
    echo "flightpower-tray: must be run as root: sudo flightpower-tray" >&2
    exit 1
fi

install -d -m 0755 "$(dirname "$tray")" "$dropin"
if [ ! -e "$tray" ]; then
    "$daq" config --example | sed 's|^directory = "logs"|directory = "/var/lib/flightpower"|' > "$tray.new"
    mv "$tray.new" "$tray"
    echo "$tray is the example tray: edit it, then run ${AGAIN:-flightpower-tray}"
fi

# An error in the tray file, or in a file that it names, is reported before the service is stopped.
[ $restart = no ] || "$daq" config --check "$tray" >/dev/null
# The sandbox permits only the devices of this tray.
"$daq" config --unit "$tray" > "$dropin/tray.conf.new"
mv "$dropin/tray.conf.new" "$dropin/tray.conf"

if [ $restart = yes ]; then
    systemctl daemon-reload
    systemctl restart --no-block flightpower-daq.service
fi
