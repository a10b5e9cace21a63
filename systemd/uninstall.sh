#!/bin/sh
# Removes the service from this computer. Can be run again. The tray file in /etc/flightpower is deleted only with
# --purge-tray. Logs in /var/lib/flightpower are never deleted by this script.
set -eu

root=${DESTDIR:-}

if [ -z "$root" ] && [ "$(id -u)" -ne 0 ]; then
    echo "uninstall.sh: must be run as root: sudo $0" >&2
    exit 1
fi

if [ -z "$root" ] && systemctl cat flightpower-daq.service >/dev/null 2>&1; then
    systemctl disable --now flightpower-daq.service # finishes the log
fi

if [ -z "$root" ] && systemctl cat flightpower-status.service >/dev/null 2>&1; then
    systemctl disable --now flightpower-status.service
fi

rm -f "$root/etc/systemd/system/flightpower-daq.service"
rm -f "$root/etc/systemd/system/flightpower-status.service"
rm -f "$root/etc/systemd/system/flightpower-daq.service.d/tray.conf"
if [ -d "$root/etc/systemd/system/flightpower-daq.service.d" ]; then
    # Other drop-ins are kept.
    rmdir --ignore-fail-on-non-empty "$root/etc/systemd/system/flightpower-daq.service.d"
fi
rm -f "$root/etc/udev/rules.d/60-flightpower.rules"
rm -f "$root/usr/lib/sysusers.d/flightpower.conf"

if [ "${1:-}" = "--purge-tray" ]; then
    # These files were made by the commands; the user's own calibrations and aircraft files stay.
    for name in tray.toml zero.json check.json; do
        rm -f "$root/etc/flightpower/$name"
    done
    [ ! -d "$root/etc/flightpower" ] || rmdir --ignore-fail-on-non-empty "$root/etc/flightpower"
fi

if [ -z "$root" ]; then
    rm -rf /opt/flightpower
    systemctl daemon-reload
    udevadm control --reload
fi
