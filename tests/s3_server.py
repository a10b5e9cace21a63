"""A store of objects in memory that speaks S3 as far as s3fs asks, and fails where a test wants it to.

It replaces an implementation of all of S3, whose import takes longer than all tests here.
"""

import hashlib
import re
import threading
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape

PAGE = 1000
CHANGED = "2026-05-01T09:00:00.000Z"


class Store(ThreadingHTTPServer):
    """objects: contents by "bucket/key". failing: how many requests are refused as too many, by "bucket/key", or by
    bucket for its list. torn: objects of which only half arrives. parts: by object that is being written, by part
    number. requests: how often each object was read, and each bucket listed."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.objects: dict[str, bytes] = {}
        self.failing: dict[str, int] = defaultdict(int)
        self.torn: set[str] = set()
        self.parts: dict[str, dict[int, bytes]] = {}
        self.requests: Counter[str] = Counter()
        self.lock = threading.Lock()

    @property
    def environment(self) -> dict[str, str]:
        """Environment variables through which a client finds the store."""
        return {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.server_port}",
            "AWS_ACCESS_KEY_ID": "user",
            "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_DEFAULT_REGION": "us-east-1",
        }


@contextmanager
def running() -> Iterator[Store]:
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()  # the tests must not use the variables of a real store
    with Store() as store:
        threading.Thread(target=store.serve_forever, args=(0.05,), daemon=True).start()
        yield store
        store.shutdown()


class _Handler(BaseHTTPRequestHandler):
    server: Store
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: object) -> None: ...

    def do_GET(self) -> None:
        url = urlsplit(self.path)
        bucket, _, key = unquote(url.path).strip("/").partition("/")
        place = f"{bucket}/{key}" if key else bucket
        with self.server.lock:
            self.server.requests[place] += self.command == "GET"
            refused = self.server.failing[place] > 0
            self.server.failing[place] -= refused
        if refused:
            self._fail(503, "SlowDown", "Please reduce your request rate.")
        elif not any(name.startswith(f"{bucket}/") for name in self.server.objects):
            self._fail(404, "NoSuchBucket", "The specified bucket does not exist")
        elif not key:
            self._list(bucket, {name: values[0] for name, values in parse_qs(url.query).items()})
        elif place not in self.server.objects:
            self._fail(404, "NoSuchKey", "The specified key does not exist.")
        else:
            self._object(place)

    do_HEAD = do_GET

    def do_PUT(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        place, query = self._asked()
        if "partNumber" in query:
            self.server.parts[place][int(query["partNumber"])] = body
        else:
            self.server.objects[place] = body
        self._answer(200, b"", {"ETag": _etag(body)})

    def do_POST(self) -> None:
        """Begin or complete an upload in parts, whose file appears when it is whole."""
        self.rfile.read(int(self.headers.get("Content-Length", 0)))
        place, query = self._asked()
        bucket, _, key = place.partition("/")
        names = f"<Bucket>{escape(bucket)}</Bucket><Key>{escape(key)}</Key>"
        if "uploads" in query:
            self.server.parts[place] = {}
            kind, more = "InitiateMultipartUploadResult", "<UploadId>one</UploadId>"
        else:
            self.server.objects[place] = b"".join(part for _, part in sorted(self.server.parts.pop(place).items()))
            kind, more = "CompleteMultipartUploadResult", f"<ETag>{escape(_etag(self.server.objects[place]))}</ETag>"
        xml = f'<{kind} xmlns="http://s3.amazonaws.com/doc/2006-03-01/">{names}{more}</{kind}>'
        self._answer(200, xml.encode(), {"Content-Type": "application/xml"})

    def _asked(self) -> tuple[str, dict[str, str]]:
        """Place and query of a request."""
        url = urlsplit(self.path)
        query = parse_qs(url.query, keep_blank_values=True)
        return unquote(url.path).strip("/"), {name: values[0] for name, values in query.items()}

    def _object(self, place: str) -> None:
        content, status = self.server.objects[place], 200
        headers = {"ETag": _etag(content), "Last-Modified": "Fri, 01 May 2026 09:00:00 GMT"}
        if part := re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", "")):
            first, last = int(part[1]), min(int(part[2] or len(content)), len(content) - 1)
            headers["Content-Range"] = f"bytes {first}-{last}/{len(content)}"
            content, status = content[first : last + 1], 206
        if place in self.server.torn and self.command == "GET":
            content = content[: len(content) // 2]
        self._answer(status, content, headers)

    def _list(self, bucket: str, query: Mapping[str, str]) -> None:
        prefix, after = f"{bucket}/{query.get('prefix', '')}", query.get("continuation-token", "")
        names = sorted(name for name in self.server.objects if name.startswith(prefix) and name > after)
        groups: set[str] = set()
        if delimiter := query.get("delimiter"):
            inside = {name: name[len(prefix) :].partition(delimiter) for name in names}
            groups = {prefix + first + delimiter for first, more, _ in inside.values() if more}
            names = [name for name, (_, more, _) in inside.items() if not more]
        page = names[: int(query.get("max-keys", PAGE))]
        cut = len(bucket) + 1
        entries = [
            f"<Contents><Key>{escape(name[cut:])}</Key><LastModified>{CHANGED}</LastModified><ETag>"
            f"{escape(_etag(self.server.objects[name]))}</ETag><Size>{len(self.server.objects[name])}</Size></Contents>"
            for name in page
        ]
        entries += [
            f"<CommonPrefixes><Prefix>{escape(prefix[cut:])}</Prefix></CommonPrefixes>" for prefix in sorted(groups)
        ]
        more = len(page) < len(names)
        entries.append(f"<IsTruncated>{str(more).lower()}</IsTruncated><KeyCount>{len(page)}</KeyCount>")
        if more:
            entries.append(f"<NextContinuationToken>{escape(page[-1])}</NextContinuationToken>")
        xml = f'<ListBucketResult xmlns="http://s3.amazonaws.com/doc/2006-03-01/">{"".join(entries)}</ListBucketResult>'
        self._answer(200, xml.encode(), {"Content-Type": "application/xml"})

    def _fail(self, status: int, code: str, message: str) -> None:
        self._answer(status, f"<Error><Code>{code}</Code><Message>{message}</Message></Error>".encode(), {})

    def _answer(self, status: int, content: bytes, headers: Mapping[str, str]) -> None:
        self.send_response(status)
        for name, value in {**headers, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)


def _etag(content: bytes) -> str:
    return f'"{hashlib.md5(content, usedforsecurity=False).hexdigest()}"'
