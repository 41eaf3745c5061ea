"""A small Hub on this machine: real HTTP, repositories in memory, and faults on demand.

Speaks the routes that `huggingface_hub` and LeRobot use for data sets and models: repositories, preupload, LFS,
commit, tags, branches, refs, tree and resolve. A client finds it through `HF_ENDPOINT`, which is read at import, so
tests run the client in a subprocess with `environment()`.
"""

import base64
import hashlib
import json
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

TOKEN = "hf_" + "LocalHubTokenForTests0123456789ab"
READ_TOKEN = "hf_" + "LocalHubTokenThatMayOnlyRead01234"
_LFS_SUFFIXES = (".parquet", ".mcap", ".mp4", ".safetensors", ".png")


@dataclass
class Repository:
    """One repository: every commit is a full listing of its files."""

    private: bool
    commits: dict[str, dict[str, bytes]] = field(default_factory=dict)
    messages: dict[str, str] = field(default_factory=dict)
    branches: dict[str, str] = field(default_factory=dict)
    tags: dict[str, str] = field(default_factory=dict)

    def commit(self, files: dict[str, bytes], message: str, branch: str = "main") -> str:
        """Adds a commit on a branch and returns its id."""
        parent = self.branches.get(branch, "")
        listing = "".join(f"{name}\0{hashlib.sha1(data).hexdigest()}\0" for name, data in sorted(files.items()))
        oid = hashlib.sha1(f"{parent}{message}{len(self.commits)}{listing}".encode()).hexdigest()
        self.commits[oid], self.messages[oid], self.branches[branch] = files, message, oid
        return oid

    def resolve(self, revision: str) -> str | None:
        """Commit of a branch, tag or commit."""
        known = {**self.branches, **self.tags}
        return known.get(revision) or (revision if revision in self.commits else None)

    @property
    def head(self) -> dict[str, bytes]:
        """Files on `main`."""
        return self.commits[self.branches["main"]]


@dataclass
class Fault:
    """What goes wrong with the next requests of a kind.

    Attributes:
        status: reply with this instead of doing anything.
        drop: `before` closes the connection instead of doing anything, `after` does it and closes without a reply,
            `middle` does it and closes after half of the reply's body.
        action: runs first, such as somebody else's commit.
    """

    method: str
    path: str
    times: int
    status: int | None = None
    drop: str | None = None
    action: Callable[[], object] | None = None


class LocalHub:
    """Serves until the end of a `with` block.

    Attributes:
        requests: method, path and status of everything asked for, in order.
        uploads: sha256 of every LFS file that was sent, in order.
    """

    def __init__(self):
        self.repositories: dict[tuple[str, str], Repository] = {}
        self.lfs: dict[str, bytes] = {}
        self.requests: list[tuple[str, str, int]] = []
        self.uploads: list[str] = []
        self.faults: list[Fault] = []
        self.lock = threading.RLock()

    def __enter__(self) -> "LocalHub":
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.02})
        self._thread.start()
        return self

    def __exit__(self, *_) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}"

    def environment(self, home: Path, token: str | None = TOKEN) -> dict[str, str]:
        """What a subprocess needs in its environment so that its client talks to this hub and to nothing else."""
        variables = {
            "HF_ENDPOINT": self.url,
            "HF_HOME": str(home / "huggingface"),
            "HF_LEROBOT_HOME": str(home / "lerobot"),
            "HF_HUB_DISABLE_XET": "1",
            "HF_HUB_DISABLE_TELEMETRY": "1",
            "HF_HUB_DISABLE_PROGRESS_BARS": "1",
            "HF_HUB_OFFLINE": "0",
            "NO_PROXY": "127.0.0.1",
            "no_proxy": "127.0.0.1",
        }
        return {**variables, "HF_TOKEN": token} if token else variables

    def forget(self) -> None:
        """Starts anew, empty and without faults."""
        for everything in (self.repositories, self.lfs, self.requests, self.uploads, self.faults):
            everything.clear()

    def data_set(self, repo_id: str) -> Repository:
        """A data set repository that exists."""
        return self.repositories["dataset", repo_id]

    def fail(self, method: str, path: str, status: int, times: int = 1) -> None:
        """Answers the next requests whose path matches with an error."""
        self.faults.append(Fault(method, path, times, status=status))

    def drop(self, method: str, path: str, when: str, times: int = 1) -> None:
        """Closes the connection of the next requests whose path matches: `before`, `middle` or `after`."""
        self.faults.append(Fault(method, path, times, drop=when))

    def meanwhile(self, method: str, path: str, action: Callable[[], object]) -> None:
        """Does something just before the next request whose path matches is served."""
        self.faults.append(Fault(method, path, 1, action=action))

    def take_fault(self, method: str, path: str) -> Fault | None:
        with self.lock:
            for fault in self.faults:
                if fault.times and fault.method == method and re.search(fault.path, path):
                    fault.times -= 1
                    return fault
        return None


class HttpError(Exception):
    """A reply other than 200."""

    def __init__(self, status: int, message: str, code: str | None = None):
        super().__init__(message)
        self.status, self.code = status, code


def _handler(hub: LocalHub) -> type[BaseHTTPRequestHandler]:
    class Handler(_Handler):
        pass

    Handler.hub = hub
    return Handler


_KIND = r"/api/(?P<kind>dataset|model)s/(?P<id>[^/]+/[^/]+)"
_FILE = r"/(?:(?P<prefix>datasets)/)?(?P<id>[^/]+/[^/]+)/resolve/(?P<revision>[^/]+)/(?P<path>.+)"
_ROUTES = [
    ("POST", r"/api/validate-yaml", "validate"),
    ("GET", r"/api/whoami-v2", "whoami"),
    ("POST", r"/api/repos/create", "create"),
    ("GET", rf"{_KIND}/refs", "refs"),
    ("GET", rf"{_KIND}(?:/revision/(?P<revision>[^/]+))?", "info"),
    ("GET", rf"{_KIND}/tree/(?P<revision>[^/]+)", "tree"),
    ("POST", rf"{_KIND}/preupload/(?P<revision>[^/]+)", "preupload"),
    ("POST", rf"{_KIND}/commit/(?P<revision>[^/]+)", "commit"),
    ("POST", rf"{_KIND}/tag/(?P<revision>[^/]+)", "tag"),
    ("DELETE", rf"{_KIND}/tag/(?P<revision>[^/]+)", "delete_tag"),
    ("POST", rf"{_KIND}/branch/(?P<revision>[^/]+)", "branch"),
    ("POST", r"/(?:(?P<prefix>datasets)/)?(?P<id>[^/]+/[^/]+)\.git/info/lfs/objects/batch", "lfs_batch"),
    ("PUT", r"/lfs/(?P<oid>[0-9a-f]{64})", "lfs_put"),
    ("GET", _FILE, "file"),
    ("HEAD", _FILE, "file"),
]
_WRITES = {"create", "preupload", "commit", "tag", "delete_tag", "branch", "lfs_batch"}
_OPEN = {"validate", "lfs_put"}  # the address of an upload is its own permission


class _Handler(BaseHTTPRequestHandler):
    hub: LocalHub
    protocol_version = "HTTP/1.1"

    def log_message(self, format, *args):
        pass

    def do_GET(self):
        self._serve()

    do_HEAD = do_POST = do_PUT = do_DELETE = do_GET  # noqa: N815

    def _serve(self) -> None:
        self.close_connection = False
        url = urlsplit(self.path)
        self._body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        fault = self.hub.take_fault(self.command, url.path)
        if fault and fault.action:
            fault.action()
        if fault and fault.drop == "before":
            self._close(url.path)
            return
        headers: dict[str, str] = {}
        try:
            if fault and fault.status:
                raise HttpError(fault.status, "injected")
            with self.hub.lock:
                status, reply, headers = self._route(url.path, {k: v[0] for k, v in parse_qs(url.query).items()})
        except HttpError as error:
            status, reply = error.status, json.dumps({"error": str(error)}).encode()
            headers = {"X-Error-Message": str(error), **({"X-Error-Code": error.code} if error.code else {})}
        if fault and fault.drop == "after":
            self._close(url.path)
            return
        self.hub.requests.append((self.command, url.path, status))
        self.send_response(status)
        for name, value in {"Content-Length": str(len(reply)), **headers}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            half = fault is not None and fault.drop == "middle"
            self.wfile.write(reply[: len(reply) // 2] if half else reply)
            self.close_connection = self.close_connection or half

    def _close(self, path: str) -> None:
        self.hub.requests.append((self.command, path, 0))
        self.close_connection = True

    def _route(self, path: str, query: dict[str, str]) -> tuple[int, bytes, dict[str, str]]:
        for method, pattern, name in _ROUTES:
            match = re.fullmatch(pattern, path)
            if method == self.command and match:
                parts = {key: unquote(value) for key, value in match.groupdict().items() if value is not None}
                if name not in _OPEN:
                    self._authorise(name in _WRITES)
                answer = getattr(self, f"_{name}")(query, **parts)
                return answer if isinstance(answer, tuple) else (200, json.dumps(answer).encode(), {})
        raise HttpError(404, f"no route {self.command} {path}")

    def _authorise(self, writes: bool) -> None:
        header = self.headers.get("Authorization")
        if header not in (None, f"Bearer {TOKEN}", f"Bearer {READ_TOKEN}"):
            raise HttpError(401, "Invalid credentials in Authorization header")
        if writes and header is None:
            raise HttpError(401, "Invalid username or password.")
        if writes and header == f"Bearer {READ_TOKEN}":
            raise HttpError(403, "You don't have the required permissions to perform this operation")

    def _repository(self, kind: str, id: str) -> Repository:
        repository = self.hub.repositories.get((kind, id))
        if repository is None or (repository.private and not self.headers.get("Authorization")):
            # Without a token the Hub does not tell what is private from what is not there.
            status = 404 if self.headers.get("Authorization") else 401
            raise HttpError(status, "Repository not found", "RepoNotFound")
        return repository

    def _at(self, repository: Repository, revision: str) -> str:
        commit = repository.resolve(revision)
        if commit is None:
            raise HttpError(404, f"Invalid rev id: {revision}", "RevisionNotFound")
        return commit

    def _json(self) -> Any:
        return json.loads(self._body)

    def _validate(self, query):
        return {"errors": [], "warnings": []}

    def _whoami(self, query):
        return {"name": "lab", "type": "user", "orgs": []}

    def _create(self, query):
        wanted = self._json()
        key = (wanted.get("type") or "model", "/".join(filter(None, (wanted.get("organization"), wanted["name"]))))
        answer = {"url": f"{self.hub.url}/{key[0]}s/{key[1]}" if key[0] == "dataset" else f"{self.hub.url}/{key[1]}"}
        if key in self.hub.repositories:
            return 409, json.dumps({**answer, "error": "You already created this repo"}).encode(), {}
        repository = Repository(wanted.get("visibility") == "private" or bool(wanted.get("private")))
        repository.commit({".gitattributes": b"*.parquet filter=lfs diff=lfs merge=lfs -text\n"}, "initial commit")
        self.hub.repositories[key] = repository
        return answer

    def _refs(self, query, kind, id):
        repository = self._repository(kind, id)
        named = {"branches": ("heads", repository.branches), "tags": ("tags", repository.tags)}
        refs = {
            group: [{"name": name, "ref": f"refs/{folder}/{name}", "targetCommit": oid} for name, oid in refs.items()]
            for group, (folder, refs) in named.items()
        }
        return {**refs, "converts": []}

    def _info(self, query, kind, id, revision="main"):
        repository = self._repository(kind, id)
        commit = self._at(repository, revision)
        siblings = [{"rfilename": name} for name in sorted(repository.commits[commit])]
        fields = {"id": id, "sha": commit, "private": repository.private, "siblings": siblings}
        return {**fields, "tags": [], "downloads": 0, "likes": 0, "disabled": False, "gated": False}

    def _tree(self, query, kind, id, revision):
        repository = self._repository(kind, id)
        files = repository.commits[self._at(repository, revision)]
        return [_tree_entry(name, data) for name, data in sorted(files.items())]

    def _preupload(self, query, kind, id, revision):
        repository = self._repository(kind, id)
        files = repository.commits[self._at(repository, revision)]
        return {
            "files": [
                {
                    "path": file["path"],
                    "uploadMode": "lfs" if file["path"].endswith(_LFS_SUFFIXES) else "regular",
                    "shouldIgnore": False,
                    "oid": _oid(file["path"], files[file["path"]]) if file["path"] in files else None,
                }
                for file in self._json()["files"]
            ]
        }

    def _lfs_batch(self, query, id, prefix=None):
        objects = []
        for wanted in self._json()["objects"]:
            upload = {"upload": {"href": f"{self.hub.url}/lfs/{wanted['oid']}", "header": {}}}
            objects.append({**wanted, **({} if wanted["oid"] in self.hub.lfs else {"actions": upload})})
        answer = json.dumps({"transfer": "basic", "objects": objects}).encode()
        return 200, answer, {"Content-Type": "application/vnd.git-lfs+json"}

    def _lfs_put(self, query, oid):
        if hashlib.sha256(self._body).hexdigest() != oid:
            raise HttpError(400, "The content does not match its sha256")
        self.hub.lfs[oid] = self._body
        self.hub.uploads.append(oid)
        return {}

    def _commit(self, query, kind, id, revision):
        repository = self._repository(kind, id)
        lines = [json.loads(line) for line in self._body.splitlines()]
        header = lines[0]["value"]
        head = repository.branches[revision]
        if header.get("parentCommit") not in (None, head):
            raise HttpError(412, "A commit has happened since. Please refresh and try again.")
        files = dict(repository.commits[head])
        for line in lines[1:]:
            value, path = line["value"], line["value"]["path"]
            if line["key"] == "file":
                files[path] = base64.b64decode(value["content"])
            elif line["key"] == "lfsFile":
                if value["oid"] not in self.hub.lfs:
                    raise HttpError(400, f"{path}: LFS object does not exist")
                files[path] = self.hub.lfs[value["oid"]]
            elif line["key"] == "deletedFile":
                del files[path]
            else:
                files = {name: data for name, data in files.items() if not name.startswith(path)}
        message = f"{header['summary']}\n\n{header.get('description', '')}"
        oid = repository.commit(files, message, revision)
        return {"commitUrl": f"{self.hub.url}/datasets/{id}/commit/{oid}", "commitOid": oid, "success": True}

    def _tag(self, query, kind, id, revision):
        repository = self._repository(kind, id)
        name = self._json()["tag"]
        if name in repository.tags:
            raise HttpError(409, f"Tag {name} already exists")
        repository.tags[name] = self._at(repository, revision)
        return {}

    def _delete_tag(self, query, kind, id, revision):
        repository = self._repository(kind, id)
        if repository.tags.pop(revision, None) is None:
            raise HttpError(404, f"Invalid rev id: {revision}", "RevisionNotFound")
        return {}

    def _branch(self, query, kind, id, revision):
        repository = self._repository(kind, id)
        if revision in repository.branches:
            raise HttpError(409, f"Branch {revision} already exists")
        repository.branches[revision] = self._at(repository, self._json().get("startingPoint") or "main")
        return {}

    def _file(self, query, id, revision, path, prefix=None):
        repository = self._repository("dataset" if prefix else "model", id)
        commit = self._at(repository, revision)
        data = repository.commits[commit].get(path)
        if data is None:
            raise HttpError(404, "Entry not found", "EntryNotFound")
        headers = {"ETag": f'"{_oid(path, data)}"', "X-Repo-Commit": commit, "Accept-Ranges": "bytes"}
        if path.endswith(_LFS_SUFFIXES):
            headers.update({"X-Linked-Etag": headers["ETag"], "X-Linked-Size": str(len(data))})
        wanted = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range") or "")
        if wanted:
            begin, end = int(wanted[1]), int(wanted[2] or len(data) - 1)
            headers["Content-Range"] = f"bytes {begin}-{end}/{len(data)}"
            return 206, data[begin : end + 1], headers
        return 200, data, headers


def _oid(path: str, data: bytes) -> str:
    if path.endswith(_LFS_SUFFIXES):
        return hashlib.sha256(data).hexdigest()
    return hashlib.sha1(b"blob %d\0" % len(data) + data).hexdigest()


def _tree_entry(path: str, data: bytes) -> dict[str, Any]:
    entry: dict[str, Any] = {"type": "file", "path": path, "size": len(data), "oid": _oid(path, data)}
    if path.endswith(_LFS_SUFFIXES):
        entry["lfs"] = {"oid": entry["oid"], "size": len(data), "pointerSize": 134}
    return entry
