"""Whatever is given by mistake: the right exit code, one line on stderr that says what is wrong and where, nothing
written.

Each line of WRONG is a command as it is typed, in a folder with the files of `given`, and words of its message. Run as
a program, this module prints the table with the whole messages.
"""

import contextlib
import io
import os
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import flightpower.analysis.cli.analyze
import flightpower.analysis.cli.calibrate
import flightpower.command
import flightpower.daq.__main__
import flightpower.simulate
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.command_line import ExitCode

MAIN: dict[str, Callable[[], None]] = {
    "analyze": flightpower.analysis.cli.analyze.main,
    "calibrate": flightpower.analysis.cli.calibrate.main,
    "daq": flightpower.daq.__main__.main,
    "flightpower": flightpower.command.main,
    "sim": flightpower.simulate.main,
}

WRONG = {
    # plan
    "flightpower plan missing": "aircraft missing: neither a file nor one of",
    "flightpower plan nexstar --question speed": "'speed' is not one of 'curve', 'endurance'",
    "flightpower plan nexstar --pilot hand": "'hand' is not one of 'line-of-sight', 'autopilot'",
    "flightpower plan nexstar --minutes 0": "--minutes 0: should be above 0 and at most 240 min",
    "flightpower plan nexstar --wind-kt -3": "--wind-kt -3: should be at least 0",
    "flightpower plan nexstar --home here": "--home here: should be latitude and longitude",
    "flightpower plan nexstar --home 91,0": "--home 91,0: latitude should be within 85",
    "flightpower plan nexstar --after probe.json": "probe.json: format 'flightpower-probe-2' is not supported",
    "flightpower plan nexstar -o empty.txt": "empty.txt",
    "flightpower plan nexstar -o planned": "planned/plan.toml: exists already; give --replace",
    # export
    "flightpower export stood.mcap --to mat -o probe.json": "probe.json: exists already; give --replace",
    "flightpower export stood.mcap --to csv -o flown": "flown: is not empty; give --replace",
    # analyze: the log
    "analyze stood.mcap --mass '1e-9 kg'": "--mass 1e-9 kg: should be at least 0.01 and at most 1000 kg",
    "flightpower parameters probe.json -o new": "Choose from: ardupilot, px4, inav; see",
    "flightpower parameters folder --for px4 -o new": "folder/results.json: cannot be read (No such file",
    "flightpower open mine.toml --no-browser": "mine.toml: text, which is not read",
    "flightpower open binary.bin --no-browser": "binary.bin: a file that begins with the bytes",
    "analyze missing.mcap": "missing.mcap: cannot be read",
    "analyze .": ".: cannot be read, it is a folder; give a log, such as no-probe.mcap",
    "analyze folder": "folder: cannot be read",
    "analyze ''": ": cannot be read",
    "analyze empty.txt": "empty.txt: the file is empty",
    "analyze tunnel.csv": "tunnel.csv: a table, whose columns need a map: flightpower new columns tunnel.csv",
    "analyze torn.mcap": "torn.mcap: holds no message",
    "analyze stood.mcap": "stood.mcap: /rpm: motor_speed_revps was never measured",
    "analyze no-probe.mcap": "give --probe FILE",
    "analyze stood.mcap empty.txt": "several logs: give the folder for the results with -o",
    "analyze compare stood.mcap empty.txt": "stood.mcap: is not a folder; give one that `analyze` wrote",
    # … its outputs and options
    "analyze stood.mcap -o empty.txt": "empty.txt: is a file",
    "analyze stood.mcap -o empty.txt/report": "cannot be written",
    "analyze stood.mcap --spam": "No such option: --spam",
    "analyze stood.mcap --runs": "requires an argument",
    "analyze stood.mcap --aircraft missing.toml": "missing.toml: neither a file nor one of",
    "analyze stood.mcap --aircraft folder": "folder: neither a file nor one of",
    "analyze stood.mcap --aircraft binary.bin": "binary.bin: not a text file",
    "analyze stood.mcap --aircraft empty.txt": "geometry.span is missing",
    "analyze stood.mcap --aircraft probe.json": "probe.json: not valid TOML",
    "analyze stood.mcap --aircraft no-unit.toml": "no-unit.toml: geometry.span = 1.7",
    "analyze stood.mcap --aircraft nan.toml": "nan.toml: geometry.span = 'nan m'",
    "analyze stood.mcap --aircraft huge.toml": "huge.toml: geometry.span = '1e400 m'",
    "analyze stood.mcap --aircraft negative.toml": "mass.weight: must be greater than zero",
    "analyze stood.mcap --probe missing.json": "missing.json: cannot be read",
    "analyze stood.mcap --probe folder": "folder: cannot be read",
    "analyze stood.mcap --probe mine.toml": "mine.toml: not a probe calibration",
    "analyze stood.mcap --magnetometer probe.json": "probe.json: not a magnetometer calibration",
    "analyze stood.mcap --transducers probe.json": "probe.json: not a transducer calibration",
    "analyze stood.mcap --thrust-stand probe.json": "probe.json: not a result of `calibrate thrust`",
    "analyze stood.mcap --zero probe.json": "probe.json: not a still-air zero",
    "analyze stood.mcap --propeller apc-99x9": "apc-99x9: neither a file nor one of",
    "analyze stood.mcap --propeller binary.bin": "binary.bin: not a text file",
    "analyze stood.mcap --propeller folder": "folder: no UIUC table here",
    "analyze stood.mcap --propeller tunnel.csv": "propeller tunnel: no line `# diameter_m",
    "analyze stood.mcap --weight 4.1": "--weight '4.1'",
    "analyze stood.mcap --weight 'nan kg'": "--weight 'nan kg'",
    "analyze stood.mcap --weight '-4 kg'": "--weight '-4 kg'",
    "analyze stood.mcap --weights '4 kg,,5 kg'": "--weights ''",
    "analyze stood.mcap --battery-Wh '5000 mAh'": "give the voltage as well",
    "analyze stood.mcap --battery-Wh '74 W'": "--battery-Wh 74 W",
    "analyze stood.mcap --battery-Wh nan": "--battery-Wh nan",
    "analyze stood.mcap --usable 80": "--usable 80",
    "analyze stood.mcap --usable '-80 %'": "--usable -80 %",
    "analyze stood.mcap --density-altitudes 1000": "--density-altitudes '1000'",
    "analyze stood.mcap --density-altitudes '20 km'": "--density-altitudes '20 km'",
    "analyze stood.mcap --runs missing.toml": "missing.toml: cannot be read",
    "analyze stood.mcap --runs folder": "folder: cannot be read",
    "analyze stood.mcap --runs binary.bin": "binary.bin: not a text file",
    "analyze stood.mcap --runs mine.toml": "mine.toml: unknown key",
    "analyze stood.mcap --runs empty.txt": "empty.txt: has no [[run]] table",
    "analyze stood.mcap --runs none-kept.toml": "none-kept.toml: no [[run]] has keep = true",
    "analyze stood.mcap --runs no-unit-run.toml": "run 1.start = 3",
    # calibrate
    "calibrate spam": "No such command 'spam'",
    "calibrate probe missing.csv -o new.json": "missing.csv: cannot be read",
    "calibrate probe folder -o new.json": "folder: cannot be read (it is a folder)",
    "calibrate probe binary.bin -o new.json": "binary.bin: not a text file",
    "calibrate probe empty.txt -o new.json": "empty.txt: holds no measurements",
    "calibrate probe mine.toml -o new.json": "mine.toml: column",
    "calibrate probe nan.csv -o new.json": "nan.csv: column 'alpha [deg]': not a number in every line",
    "calibrate probe words.csv -o new.json": "in every line; the first without: 15,left,0,10,",
    "calibrate probe one-angle.csv -o new.json": "one-angle.csv: alpha and beta must both vary",
    "calibrate probe zero.csv -o new.json": "zero.csv: q_c and speed must be positive",
    "calibrate probe no-unit.csv -o new.json": "no-unit.csv: column 'alpha'",
    "calibrate probe no-column.csv -o new.json": "no-column.csv: no column temperature",
    "calibrate probe few.csv -o new.json": "few.csv: ",
    "calibrate probe tunnel.csv -o probe.json": "probe.json: exists already; give --replace",
    "calibrate probe tunnel.csv -o folder": "folder: cannot be written",
    "calibrate probe tunnel.csv -o ''": "cannot be written (it is a folder)",
    "calibrate probe tunnel.csv -o empty.txt/new.json": "empty.txt/new.json: cannot be written",
    "calibrate probe tunnel.csv -o new.json --report new.json": "cannot be the same file",
    "calibrate probe tunnel.csv -o new.json --angle-scale nan": "--angle-scale nan",
    "calibrate probe tunnel.csv -o new.json --angle-scale '2 deg'": "--angle-scale 2 deg",
    "calibrate tubing missing.mcap": "missing.mcap: cannot be read",
    "calibrate tubing stood.mcap --aircraft probe.json": "probe.json: not valid TOML",
    "calibrate tubing stood.mcap -o mine.toml": "mine.toml: exists already",
    "calibrate magnetometer tunnel.csv -o new.json": "tunnel.csv: text, which is not read",
    "calibrate magnetometer stood.mcap -o probe.json": "probe.json: exists already",
    "calibrate transducers stood.mcap": "no pressure was held for five seconds",
    "calibrate transducers stood.mcap --pressures '10 20'": "--pressures '10 20': numbers and their unit are needed",
    "calibrate transducers stood.mcap --reference-error 50": "--reference-error 50",
    "calibrate transducers stood.mcap -o probe.json": "probe.json: exists already",
    "calibrate thrust tunnel.csv": "--propeller, --aircraft: give one of the two",
    "calibrate thrust tunnel.csv --propeller apc-12x8e": "column 'speed [m/s]': must be one of motor_speed",
    "calibrate thrust folder --propeller apc-12x8e": "folder: cannot be read",
    "calibrate thrust tunnel.csv --propeller apc-12x8e -o probe.json": "probe.json: exists already",
    "calibrate thrust tunnel.csv --propeller apc-12x8e --pressure '1 bar'": "give both, or none",
    "calibrate weight-and-balance": "--scale: give the reading",
    "calibrate weight-and-balance --scale '4 m'": "'4 m'",
    "calibrate weight-and-balance --scale '0.1: 4 kg'": "'0.1'",
    "calibrate weight-and-balance --scale '4 kg' --reading-error 0": "--reading-error 0",
    "calibrate airspeed stood.mcap": "stood.mcap: /rpm: motor_speed_revps was never measured",
    "calibrate airspeed stood.mcap -o empty.txt/new.json": "cannot be written",
    "calibrate surfaces stood.mcap --surface wing": "'wing'",
    "calibrate surfaces stood.mcap --channel 0": "--channel 0",
    "calibrate surfaces stood.mcap --channel one": "'--channel'",
    "calibrate surfaces stood.mcap --angles '-20 x 20'": "--angles: 'x' is not an angle",
    "calibrate surfaces stood.mcap --angles 'nan 0 20'": "--angles: 'nan' is not an angle",
    # sim
    "sim fly": "Missing option '--output'",
    "sim fly -o new --aircraft spitfire": "spitfire: neither a file nor one of",
    "sim fly -o new --aircraft four-keys.toml": "four-keys.toml: the simulator also needs",
    "sim fly -o new --plan missing": "plan missing: neither a file nor one of",
    "sim fly -o new --plan binary.bin": "binary.bin: not a text file",
    "sim fly -o new --plan mine.toml": "plan mine: has no [[segment]]",
    "sim fly -o new --plan no-unit-plan.toml": "segment 1 (stand).duration = 5: give a number with a unit",
    "sim fly -o new --plan backwards.toml": "segment 1 (stand): duration",
    "sim fly -o new --plan no-climb.toml": "segment 1 (climb): climb should be above zero",
    "sim fly -o new --plan storm.toml": "air: wind should be at least zero and below 60 m/s",
    "sim fly -o new --errors huge": "errors huge: neither a file nor one of",
    "sim fly -o new --errors negative-noise.toml": "accel_mps2 is negative",
    "sim fly -o new --seed -1": "'--seed'",
    "sim fly -o new --seed 1.5": "'--seed'",
    "sim fly -o new --probe missing.json": "missing.json: no such file",
    "sim fly -o new --probe mine.toml": "mine.toml: not a probe calibration",
    "sim fly -o new --faults mine.toml": "mine.toml: only [[fault]] tables",
    "sim fly -o new --faults folder": "folder: cannot be read",
    "sim fly -o new --status state.json": "--status: only a recording in real time has a state",
    "sim fly -o new --no-hardware --real-time": "--no-hardware excludes",
    "sim fly -o empty.txt": "empty.txt: not a folder",
    "sim fly -o empty.txt/new": "cannot be written",
    "sim fly -o flown": "flown: already contains truth.parquet",
    "sim tunnel -o tunnel.csv": "tunnel.csv: exists already",
    "sim tunnel -o folder": "folder: cannot be written",
    "sim trim --speed nan": "--speed nan: should be above 0 and at most 300 m/s",
    "sim trim --speed '15 kg'": "--speed 15 kg",
    "sim trim --speed 5": "stalls at",
    "sim trim --height -9000": "--height -9000",
    "sim trim --bank 90": "--bank 90",
    "sim trim --rpm 0": "--rpm 0",
    "sim trim --climb 90": "cannot be flown at any speed",
    "sim trim --climb inf": "--climb inf",
    "sim modes --speed 200": "level flight is possible up to",
    "sim plot missing -o new.html": "missing: no such file; give truth.parquet",
    "sim plot tunnel.csv -o new.html": "tunnel.csv: not the truth of a simulated flight",
    "sim plot flown -o empty.txt": "empty.txt: exists already",
    "sim plot flown -o empty.txt/new.html": "cannot be written",
    # daq
    "daq run": "Missing option '--config'",
    "daq run -c missing.toml": "missing.toml: cannot be read",
    "daq run -c folder": "folder: cannot be read",
    "daq run -c binary.bin": "binary.bin: not a text file",
    "daq run -c probe.json": "probe.json: not valid TOML",
    "daq run -c mine.toml": "mine.toml: ",
    "daq run -c tray.toml --duration nan": "--duration nan",
    "daq run -c tray.toml --duration '-5 min'": "--duration -5 min",
    "daq check -c tray.toml --seconds 0": "--seconds 0",
    "daq zero -c tray.toml --seconds '1 kg'": "--seconds 1 kg",
    "daq zero -c tray.toml --seconds 3.9": "--seconds 3.9: should be at least 4 and at most 3600 s",
    "daq check -c tray.toml --seconds '61 min'": "--seconds 61 min: should be at least 1 and at most 3600 s",
    "daq status -c tray.toml --listen 8080": "--listen 8080: write HOST:PORT, such as 0.0.0.0:8080",
    "daq status -c tray.toml --listen 127.0.0.1:0": "--listen 127.0.0.1:0: write HOST:PORT",
    "daq status -c tray.toml --listen 127.0.0.1:65536": "--listen 127.0.0.1:65536: write HOST:PORT",
    "daq info missing.mcap": "missing.mcap: cannot be read",
    "daq info folder": "folder: cannot be read",
    "daq info tunnel.csv": "tunnel.csv: text, which is not read",
    "daq config": "give --example, --check FILE or --unit FILE",
    "daq config --check mine.toml": "mine.toml: ",
    "daq config --unit missing.toml": "missing.toml: cannot be read",
    # flightpower
    "flightpower spam": "No such command 'spam'",
    "flightpower --spam": "No such option: --spam",
    "flightpower analyze missing.mcap": "missing.mcap: cannot be read",
    "flightpower calibrate probe folder -o new.json": "folder: cannot be read",
    "flightpower sim trim --speed nan": "--speed nan",
    "flightpower daq info .": ".: cannot be read",
    "flightpower new plane": "No such command 'plane'",
    "flightpower new aircraft --like spitfire": "--like spitfire: should be one of",
    "flightpower new aircraft -o mine.toml": "mine.toml: exists already; give --replace",
    "flightpower new aircraft -o folder": "folder: cannot be written",
    "flightpower new tray -o empty.txt/tray.toml": "cannot be written",
    "flightpower new tray -o tray.toml": "tray.toml: exists already",
    # files that are something else, values that cannot be, names that lead nowhere
    "flightpower plan nexstar --wind-kt '5 furlong'": "--wind-kt 5 furlong: should be at least 0 and",
    "flightpower plan nexstar --wind-from 90": "--wind-from 90: means nothing without --heading of the legs",
    "flightpower plan nexstar --heading north": "--heading north: should be at least -360 and at",
    "flightpower plan nexstar --heading 90 --wind-from 400": "--wind-from 400: should be at least 0 and at",
    "flightpower plan nexstar --stall '0 m/s'": "--stall 0 m/s: should be above 0 and at most",
    "flightpower plan nexstar --stall '60 m/s'": "nexstar: a stall speed of 60 m/s takes a lift",
    "flightpower plan nexstar --propeller apc-4x4": "propeller apc-4x4: neither a file nor one of",
    "flightpower plan nexstar --after half.json": "half.json: not results of `analyze`",
    "flightpower plan nexstar --home 48,11,500": "--home 48,11,500: should be latitude and",
    "flightpower plan nexstar --home 'nan,nan'": "--home nan,nan: latitude should be within 85,",
    "flightpower plan big.toml": "nexstar: full throttle does not carry the",
    "flightpower plan dup.toml": "dup.toml: not valid TOML (Cannot overwrite a",
    "flightpower plan utf16.toml": "utf16.toml: not a text file in UTF-8: give",
    "flightpower plan loop": "aircraft loop: neither a file nor one of",
    "flightpower plan nexstar --leg '1 lightyear'": "--leg 1 lightyear: should be at least 100 and",
    "flightpower plan nexstar --load-factor 1": "--load-factor 1: should be above 1.2 and at",
    "flightpower plan nexstar -o loop/x": "loop/x/plan.toml: cannot be written (File",
    "flightpower route m.plan --results missing.json --wind 0": "m.plan: not a plan of QGroundControl (could not",
    "flightpower route empty.plan --results missing.json --wind 0": "empty.plan: not a plan of QGroundControl (lacks",
    "flightpower route x.kml --results missing.json --wind 0": "x.kml: has 0 lines (LineString); save only the one",
    "flightpower route bad.kml --results missing.json --wind 0": "bad.kml: not XML of INAV, and no KML (unclosed",
    "flightpower route w.waypoints --results missing.json --wind 0": "w.waypoints: line 2: not a mission item (4",
    "flightpower route a.png --results missing.json --wind 0": "a.png: not a text file in UTF-8: give another",
    "flightpower route missing.plan --results missing.json --wind 0": "missing.plan: cannot be read (No such file or",
    "flightpower route --legs '' --results missing.json --wind 0": "--legs: leg 1 '': should be distance, course",
    "flightpower route --legs '1 km 400' --results missing.json --wind 0": "the course 400 should be degrees",
    "flightpower fleet fleet": "No such command 'fleet'; see `flightpower fleet",
    "flightpower fleet missing": "No such command 'missing'; see `flightpower",
    "flightpower fleet results.json": "No such command 'results.json'; see",
    "flightpower propellers 99x99": "99x99: sizes are in inches, up to 40, such as",
    "flightpower propellers apc-12x8e --blades 9 -o loop": "No such option: --blades (Possible options:",
    "flightpower propellers --folder missing": "missing: no folder",
    "flightpower propellers --folder empty.txt": "empty.txt: no folder",
    "flightpower new columns two.csv": "two.csv: text, which is not read",
    "flightpower new columns quoted.csv": "quoted.csv: text, which is not read",
    "flightpower new columns a.png": "a.png: an image, which is not read",
    "flightpower new columns folder": "folder: cannot be read (Is a directory)",
    "flightpower new aircraft --like nexstar extra": "Got unexpected extra argument(s) (extra); see",
    "flightpower export missing.mcap --to csv": "missing.mcap: cannot be read (No such file or",
    "flightpower export stood.mcap --to excel": "--to excel: should be one of parquet, csv, mat,",
    "flightpower export zip.mcap --to csv": "zip.mcap: a ZIP archive, which is not read",
    "analyze zip.mcap": "zip.mcap: a ZIP archive, which is not read",
    "analyze head.ulg --mass 2 --wing-area 0.4 --span 2": "head.ulg: holds no message of airspeed, battery",
    "analyze x.tlog --mass 2 --wing-area 0.4 --span 2": "x.tlog: a file that begins with the bytes 00 00",
    "analyze x.data --mass 2 --wing-area 0.4 --span 2": "x.data: text, which is not read",
    "analyze loop": "loop: cannot be read",
    "analyze stood.mcap --weights '4 kg;5 kg'": "--weights '4 kg;5 kg': should be masses or",
    "analyze stood.mcap --mass 3": "stood.mcap: --mass: only for logs of",
    "analyze stood.mcap --aircraft dup.toml": "dup.toml: not valid TOML (Cannot overwrite a",
    "analyze stood.mcap --aircraft neg.toml": "neg.toml: geometry.span: must be greater than",
    "analyze stood.mcap --aircraft loop": "aircraft loop: neither a file nor one of",
    "analyze stood.mcap --columns two.csv": "stood.mcap: --columns: only for tables (CSV,",
    "analyze stood.mcap --polar a.png": "a.png: no polar: neither columns CL and CD nor",
    "analyze stood.mcap --jobs 0": "Invalid value for '--jobs': Input should be",
    "analyze stood.mcap -o loop": "loop/report.html: cannot be written",
    "analyze fleet -o out": "fleet: no logs in this folder",
    "analyze compare": "Missing argument 'A'; see `analyze compare",
    "calibrate probe quoted.csv -o new.json": "quoted.csv: holds no measurements",
    "calibrate probe a.png -o new.json": "a.png: not a text file in UTF-8: give another",
    "calibrate thrust two.csv --propeller apc-12x8e": "two.csv: column 'a;b': must be one of",
    "calibrate airspeed a.png": "a.png: an image, which is not read",
    "calibrate surfaces torn.mcap": "torn.mcap: holds no message (still being recorded, or cut by a loss of power)",
    "calibrate magnetometer zip.mcap -o new.json": "zip.mcap: a ZIP archive, which is not read",
    "sim fly -o new --world moon": "world moon: not one of bench, harsh, none,",
    "sim fly -o new --as inav": "--as inav: not known; give px4 or ardupilot or",
    "sim fly -o new --as px4 --log-faults fire": "--log-faults fire: not known; known: landed,",
    "sim fly -o new --as px4 --real-time": "--as excludes --faults and --real-time: the",
    "sim fly -o loop": "loop/log.mcap: cannot be written",
    "sim fly -o new --like spitfire": "aircraft spitfire: neither a file nor one of",
    "sim plot a.png -o new.html": "a.png: not the truth of a simulated flight,",
    "daq check -c dup.toml": "dup.toml: not valid TOML (Cannot overwrite a",
    "daq list missing": "missing: no such folder; give the one with the logs",
    "daq config --check stand.toml": "stand.toml: unknown key 'segment'; `daq config --example` shows",
    "flightpower plan mine.toml --after binary.bin": "binary.bin: not a text file in UTF-8: give another",
    "flightpower plan mine.toml --minutes 7,5": "at most 240 min: a plain number, or with a unit, such as",
    "flightpower plan mine.toml --wind-kt 7,5": "and a decimal point: 7.5",
    "analyze half.json": "results.json is read by `flightpower route`,",
    "daq list empty.txt": "empty.txt: no such folder",
    "daq info zip.mcap": "zip.mcap: a ZIP archive, which is not read",
    "daq status -c tray.toml --listen nowhere:80x": "--listen nowhere:80x: write HOST:PORT, such as",
    "daq config --check loop": "loop: cannot be read",
    "daq zero -c loop": "loop: cannot be read",
}


def typed(line: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command as it is typed."""
    out, err = io.StringIO(), io.StringIO()
    arguments = sys.argv
    sys.argv = shlex.split(line)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            MAIN[sys.argv[0]]()
    except SystemExit as stopped:
        return int(stopped.code or 0), out.getvalue(), err.getvalue()
    finally:
        sys.argv = arguments
    return 0, out.getvalue(), err.getvalue()


def give(folder: Path) -> None:
    """Write the files that the commands above name into `folder`, and go there."""
    os.chdir(folder)
    Path("folder").mkdir()
    Path("planned").mkdir()
    Path("fleet").mkdir()
    Path("loop").symlink_to("loop")
    aircraft = load_aircraft("nexstar").text
    span = 'span = "5.73 ft"'
    tunnel_line = "15,{},0,10,0,140,1000,20\n"
    header = "speed [m/s],alpha [deg],beta [deg],dp_alpha [Pa],dp_beta [Pa],q_c [Pa],static [hPa],temperature [degC]\n"
    files = {
        "binary.bin": bytes(range(256)) * 8,
        "empty.txt": "",
        "planned/plan.toml": "",
        "mine.toml": aircraft,
        "no-unit.toml": aircraft.replace(span, "span = 1.7"),
        "nan.toml": aircraft.replace(span, 'span = "nan m"'),
        "negative.toml": aircraft.replace('weight = "8.47 lbf"', 'weight = "-8.47 lbf"', 1),
        "four-keys.toml": 'name = "mine"\n[geometry]\nspan = "1.7 m"\nwing_area = "0.5 m^2"\n[mass]\nweight = "4 kg"\n',
        "none-kept.toml": '[[run]]\nkind = "acceleration"\nstart = "3 s"\nend = "9 s"\nkeep = false\n',
        "no-unit-run.toml": '[[run]]\nkind = "acceleration"\nstart = 3\nend = "9 s"\n',
        "stand.toml": '[[segment]]\nkind = "stand"\nduration = "4 s"\n',
        "no-unit-plan.toml": '[[segment]]\nkind = "stand"\nduration = 5\n',
        "backwards.toml": '[[segment]]\nkind = "stand"\nduration = "-5 s"\n',
        "no-climb.toml": '[[segment]]\nkind = "climb"\nheight = "200 m"\nclimb = "0 m/s"\n',
        "storm.toml": '[air]\nwind = "900 m/s"\n[[segment]]\nkind = "stand"\nduration = "5 s"\n',
        "huge.toml": aircraft.replace(span, 'span = "1e400 m"'),
        "negative-noise.toml": '[noise]\naccel = "-1 m/s^2"\n',
        "nan.csv": header + tunnel_line.format(0) + tunnel_line.format("nan"),
        "words.csv": header + tunnel_line.format(0) + tunnel_line.format("left"),
        "zero.csv": header + tunnel_line.format(0).replace("15,", "0,", 1) * 40,
        "one-angle.csv": header + tunnel_line.format(0) * 40,
        "no-unit.csv": header.replace("alpha [deg]", "alpha", 1) + tunnel_line.format(0),
        "no-column.csv": header.replace(",temperature [degC]", "") + tunnel_line.format(0).replace(",20\n", "\n"),
        "few.csv": header + tunnel_line.format(0) * 3,
        "utf16.toml": aircraft.encode("utf-16"),
        "dup.toml": 'name = "a"\nname = "b"\n',
        "neg.toml": aircraft.replace(span, 'span = "-1 m"'),
        "big.toml": aircraft.replace('weight = "8.47 lbf"', 'weight = "8470 lbf"', 1),
        "half.json": '{"format": "flightpower-results',
        "two.csv": "a;b\n1;2\n",
        "quoted.csv": '"time,airspeed\n1,2\n',
        "m.plan": '{"fileType": "Plan", "mission": {"items": [{"type": "SimpleItem", "command": 16, "frame": 3,'
        ' "params": [0, 0, 0, 0, "x", 1, 2]}], "plannedHomePosition": [48, 11, 500]}}',
        "empty.plan": "{}",
        "x.kml": "<kml/>",
        "bad.kml": "<kml",
        "w.waypoints": "QGC WPL 110\n0 1 0 16\n",
        "zip.mcap": b"PK\x03\x04" + bytes(100),
        "head.ulg": b"ULog\x01\x12\x35\x01" + bytes(8),
        "a.png": b"\x89PNG\r\n\x1a\n" + bytes(50),
        "x.tlog": bytes(8) + b"\xfd\0\0",
        "x.data": "hello\n",
    }
    for name, content in files.items():
        Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    for line in (
        "sim tunnel -o tunnel.csv",
        "calibrate probe tunnel.csv -o probe.json",
        "sim fly --plan stand.toml --no-hardware --probe probe.json -o flown",
        "flightpower new tray -o tray.toml",
    ):
        code, _, message = typed(line)
        assert code == 0, message
    Path("stood.mcap").write_bytes(Path("flown/log.mcap").read_bytes())
    Path("torn.mcap").write_bytes(Path("flown/log.mcap").read_bytes()[:3000])
    from tests.chain.running import rewritten

    rewritten(Path("flown"), Path("no-probe.mcap"), without_attachment="probe.json")


def contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.fixture(scope="module")
def input_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder, before = tmp_path_factory.mktemp("given"), Path.cwd()
    give(folder)
    yield folder
    os.chdir(before)


@pytest.mark.parametrize("line", WRONG)
def test_wrong_input_is_one_line_and_changes_nothing(input_folder: Path, line: str) -> None:
    before = contents(input_folder)
    code, out, err = typed(line)
    assert code == ExitCode.BAD_INPUT, err
    assert err.count("\n") == 1 and err.endswith("\n"), err
    assert WRONG[line] in err
    assert out == ""
    assert contents(input_folder) == before


if __name__ == "__main__":
    give(Path(sys.argv[1]))
    print("| command | exit code | message |\n|---|---|---|")
    for line in WRONG:
        code, _, err = typed(line)
        print(f"| `{line}` | {code} | {err.strip()} |".replace("`|`", "`\\|`"))
