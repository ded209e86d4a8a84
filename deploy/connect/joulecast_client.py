"""A client of joulecastd for Python, built from the service's OpenAPI document; needs only the standard library.

    from joulecast_client import Client
    joulecast = Client("http://127.0.0.1:8080")        # token: the argument, or JOULECAST_TOKEN
    joulecast.computeProfile(id="amr", body={"path": [{"kind": "straight", "length_m": 10}]})["energy_j"]
    for mission in joulecast.pages("listMissions", robot_id="amr", sort="ratio"): ...

Each operation is a method named by its operationId. Path and query parameters are keyword arguments (`from_` for a keyword of
Python); `body` is the body. Names are checked before a request is sent. Answers are dictionaries, or text if they are not JSON;
a problem is raised as Problem, with the field and the constraint. validate=True, with python3-jsonschema, checks requests and
answers against their schemas.
"""
import gzip
import json
import os
import urllib.error
import urllib.parse
import urllib.request


class Problem(Exception):
    """A rejected request: status, and the members of the problem document (RFC 9457)."""

    def __init__(self, status, document):
        self.status, self.document = status, document
        self.field, self.constraint = document.get("field"), document.get("constraint")
        super().__init__(f"{status}: {document.get('detail') or document}")


class Client:
    def __init__(self, url, token=None, timeout_s=60, validate=False):
        self.url, self.timeout_s = url.rstrip("/"), timeout_s
        self.token = token or os.environ.get("JOULECAST_TOKEN")
        self.document = self._exchange("GET", "/openapi.json")
        self.operations = {operation["operationId"]: (method.upper(), path, operation)
                           for path, item in self.document["paths"].items() for method, operation in item.items()}
        self.validator = None
        if validate:
            import jsonschema
            self.validator = jsonschema.Draft202012Validator

    def __dir__(self):
        return [*super().__dir__(), *self.operations]

    def __getattr__(self, name):
        if name == "operations" or name not in self.operations:
            raise AttributeError(f"the service has no operation {name}")
        method, path, operation = self.operations[name]
        parameters = operation.get("parameters", [])
        known = {parameter["name"]: parameter for parameter in parameters}
        has_body = "requestBody" in operation

        def call(*, body=None, **words):
            given = {key.removesuffix("_"): value for key, value in words.items()}
            for unknown in given.keys() - known.keys():
                raise TypeError(f"{name} has no parameter {unknown}; it has {', '.join(known) or 'none'}")
            for parameter in parameters:
                if parameter["required"] and parameter["name"] not in given:
                    raise TypeError(f"{name} needs {parameter['name']}")
            if has_body != (body is not None):
                raise TypeError(f"{name} {'needs a' if has_body else 'takes no'} body")
            if has_body:
                self._hold(operation["requestBody"]["content"]["application/json"]["schema"], body)
            target, query = path, {}
            for key, value in given.items():
                if known[key]["in"] == "path":
                    target = target.replace("{" + key + "}", urllib.parse.quote(str(value), safe=""))
                elif value is not None:
                    query[key] = str(value).lower() if isinstance(value, bool) else value
            answer = self._exchange(method, target + ("?" + urllib.parse.urlencode(query) if query else ""), body)
            for status, response in operation["responses"].items():
                content = response.get("content", {}).get("application/json")
                if status.startswith("2") and content and not isinstance(answer, str):
                    self._hold(content["schema"], answer)
            return answer

        call.__name__ = name
        call.__doc__ = f"{operation['summary']}. Takes {', '.join([*known, *(['body'] if has_body else [])]) or 'nothing'}."
        return call

    def pages(self, name, **given):
        """Every item of a list that is served in pages."""
        while True:
            page = getattr(self, name)(**given)
            yield from next(value for value in page.values() if isinstance(value, list))
            given["cursor"] = page.get("next_cursor")
            if given["cursor"] is None:
                return

    def _hold(self, schema, value):
        if self.validator is not None:
            self.validator({"components": self.document["components"], **schema}).validate(value)

    def _exchange(self, method, target, body=None):
        request = urllib.request.Request(self.url + target, method=method)
        request.add_header("Accept-Encoding", "gzip")
        if self.token:
            request.add_header("Authorization", "Bearer " + self.token)
        if body is not None:
            request.data = json.dumps(body).encode()
            request.add_header("Content-Type", "application/json")
        try:
            reply = urllib.request.urlopen(request, timeout=self.timeout_s)
        except urllib.error.HTTPError as error:
            reply = error
        with reply:
            content = reply.read()
            if reply.headers.get("Content-Encoding") == "gzip":
                content = gzip.decompress(content)
            kind = reply.headers.get_content_type()
            answer = json.loads(content) if content and kind.endswith("json") else content.decode()
        if reply.status >= 400:
            raise Problem(reply.status, answer if isinstance(answer, dict) else {"detail": answer})
        return answer
