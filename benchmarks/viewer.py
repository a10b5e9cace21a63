"""Opens logs in the open-source Foxglove Studio and looks: topics, problems, a picture of each.

    python benchmarks/viewer.py log.mcap=docs/examples/foxglove-daemon-layout.json derived.mcap=foxglove-layout.json

Each log may name a layout. Ends with 1 if the viewer reports a problem, or does not list a topic that the log has. The
pictures are to be looked at. Needs Chromium and npm, from whose registry it takes `@foxglove/studio-base` 1.48.0 and
React 17 (40 MB, once; 100 MB in out/viewer).
"""

import argparse
import http.server
import re
import subprocess
import sys
import tarfile
import threading
from pathlib import Path

from mcap.reader import make_reader

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests import browser

PACKAGES = {
    "@foxglove/studio-base@1.48.0": ("package/assets/", ""),
    "react@17.0.2": ("package/umd/react.production.min.js", "react.js"),
    "react-dom@17.0.2": ("package/umd/react-dom.production.min.js", "react-dom.js"),
}
TYPES = {".js": "text/javascript", ".html": "text/html", ".wasm": "application/wasm", ".png": "image/png"}
OPEN_WITHIN_S, DRAWN_AFTER_S = 90, 8  # a log is open when its topics are listed; plots are drawn some time later
PAGE = """<!doctype html><html><head><meta charset="utf-8">
<style>html, body, #root { height: 100%; margin: 0; overflow: hidden }</style></head><body><div id="root"></div>
<script>
window.errors = [];
window.addEventListener("error", e => errors.push(String(e.message)));
window.addEventListener("unhandledrejection", e => errors.push(String(e.reason)));
window.process = {env: {}}; window.global = window;
</script>
<script src="react.js"></script><script src="react-dom.js"></script>
<script>window["react"] = React; window["react-dom"] = ReactDOM;</script>
<script src="index.js"></script>
<script>
const settings = new Map([["colorScheme", "light"], ["telemetry.telemetryEnabled", false]]);
const configuration = {get: key => settings.get(key), set: async (key, value) => { settings.set(key, value) },
    addChangeListener() {}, removeChangeListener() {}};
const layouts = new Map();
const storage = {list: async () => [...layouts.values()], get: async (_, id) => layouts.get(id),
    put: async (_, layout) => { layouts.set(layout.id, layout); return layout },
    delete: async (_, id) => { layouts.delete(id) }, importLayouts: async () => {}};
(async () => {
    const data = await (await fetch("layout.json")).json();
    if (data.configById) {
        const baseline = {data, savedAt: new Date().toISOString()};
        layouts.set("given", {id: "given", name: "given", permission: "CREATOR_WRITE", baseline});
        localStorage.setItem("studio.profile-data", JSON.stringify({currentLayoutId: "given"}));
    }
    await initI18n();
    const properties = {deepLinks: [location.href], appConfiguration: configuration, layoutStorage: storage,
        dataSources: [new RemoteDataSourceFactory()], extensionLoaders: [], enableGlobalCss: true};
    ReactDOM.render(React.createElement(App, properties), document.getElementById("root"));
})().catch(error => errors.push(String(error.stack)));
</script></body></html>"""


class Url:
    """What `Browser.show` asks of a page."""

    def __init__(self, url: str):
        self.as_uri = lambda: url


def fetch_packages(folder: Path) -> None:
    """Studio and React from npm's registry, unpacked into `folder`, unless they are there."""
    folder.mkdir(parents=True, exist_ok=True)
    for package, (prefix, name) in PACKAGES.items():
        done = folder / f".{package.replace('/', '-')}"
        if done.exists():
            continue
        packed = subprocess.run(["npm", "pack", "--silent", package], cwd=folder, check=True, capture_output=True)
        archive = folder / packed.stdout.decode().strip().splitlines()[-1]
        with tarfile.open(archive) as tar:
            for member in tar.getmembers():
                if member.isfile() and member.name.startswith(prefix):
                    data = tar.extractfile(member)
                    assert data is not None
                    (folder / (name or Path(member.name).name)).write_bytes(data.read())
        archive.unlink()
        done.touch()


def serve(log: Path, folder: Path) -> str:
    """Serve a log and the files of a folder, with ranges, on a port of this computer. Returns the address."""

    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_HEAD(self) -> None:
            self._answer(whole=False)

        def do_GET(self) -> None:
            self._answer(whole=True)

        def _answer(self, *, whole: bool) -> None:
            name = self.path.split("?")[0].lstrip("/")
            path = log if name == log.name else folder / Path(name).name
            if not path.is_file():
                self.send_error(404)
                return
            data = path.read_bytes()
            begin, end = 0, len(data) - 1
            if part := re.match(r"bytes=(\d+)-(\d*)", self.headers.get("Range", "")):
                begin, end = int(part[1]), min(int(part[2] or end), end)
            self.send_response(206 if part else 200)
            self.send_header("Content-Type", TYPES.get(path.suffix, "application/octet-stream"))
            self.send_header("Accept-Ranges", "bytes")
            self.send_header("Content-Length", str(end - begin + 1))
            self.send_header("Content-Range", f"bytes {begin}-{end}/{len(data)}")
            self.end_headers()
            if whole:
                self.wfile.write(data[begin : end + 1])

        def log_message(self, *_: object) -> None:
            pass

    class Server(http.server.ThreadingHTTPServer):
        def handle_error(self, *_: object) -> None:
            """The browser closes connections when it ends."""

    server = Server(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_port}"


def topics_of(log: Path) -> set[str]:
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return {channel.topic for channel in summary.channels.values()}


def look(window: browser.Browser, address: str, log: Path, picture: Path) -> list[str]:
    """Open a log in the viewer, write a picture of it, and return what is wrong."""
    window.show(Url(f"{address}/page.html?ds=remote-file&ds.url={address}/{log.name}"), 1600, height=1400)  # type: ignore[arg-type]
    topics = topics_of(log)
    missing = topics
    for _ in range(OPEN_WITHIN_S):
        window.value_of("new Promise(done => setTimeout(done, 1000))")
        missing = topics - set(str(window.value_of("document.body.innerText")).split("\n"))
        if not missing:
            break
    for _ in range(DRAWN_AFTER_S):
        window.value_of("new Promise(done => setTimeout(done, 1000))")
    picture.write_bytes(window.picture())
    window.value_of("[...document.querySelectorAll('button')].find(b => b.innerText.startsWith('Problems')).click()")
    window.value_of("new Promise(done => setTimeout(done, 1000))")
    problems = str(window.value_of("document.querySelector('[role=tablist]').parentElement.innerText")).split("\n")
    problems = [line for line in problems if line not in ("Topics", "Problems", "No problems found", "")]
    print(f"{log}: {len(topics) - len(missing)} of {len(topics)} topics, {len(problems)} lines of problems; {picture}")
    return [f"no topic {topic}" for topic in sorted(missing)] + problems + list(window.value_of("errors"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", metavar="LOG[=LAYOUT]")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/viewer"), help="pictures, and the viewer itself")
    arguments = parser.parse_args()
    studio = arguments.output / "studio"
    fetch_packages(studio)
    (studio / "page.html").write_text(PAGE)
    # Studio draws with WebGL, here in software.
    options = tuple(option for option in browser.OPTIONS if option != "--disable-gpu")
    browser.OPTIONS = (*options, "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-proxy-server")
    wrong = []
    for log, _, layout in (name.partition("=") for name in arguments.logs):
        path = Path(log)
        (studio / "layout.json").write_text(Path(layout).read_text() if layout else "{}")
        address = serve(path, studio)
        with browser.started() as window:
            wrong += [f"{path}: {what}" for what in look(window, address, path, arguments.output / f"{path.stem}.png")]
    print("\n".join(wrong))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
