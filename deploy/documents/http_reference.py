"""Writes the HTTP reference (http.md) from schemas/openapi.json:

    python3 deploy/documents/http_reference.py > deploy/documents/http.md
"""

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def resolve(document, schema):
    while "$ref" in schema:
        node = document
        for part in schema["$ref"].lstrip("#/").split("/"):
            node = node[part.replace("~1", "/").replace("~0", "~")]
        schema = node
    return schema


def kind(document, schema):
    name = schema["$ref"].rsplit("/", 1)[-1] if "$ref" in schema else None
    schema = resolve(document, schema)
    if "enum" in schema:
        return " \\| ".join(f"`{'null' if value is None else value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    for word in ("oneOf", "anyOf"):
        if word in schema:
            return " or ".join(dict.fromkeys(kind(document, option) for option in schema[word]))
    types = schema.get("type", "any")
    types = types if isinstance(types, list) else [types]
    text = " or ".join(types)
    if "array" in types and "items" in schema:
        text = text.replace("array", f"array of {kind(document, schema['items'])}")
    return f"{name} ({text})" if name and "object" in types else text


def bounds(schema):
    parts = []
    for key, sign in (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"), ("exclusiveMaximum", "<")):
        if key in schema:
            parts.append(f"{sign} {schema[key]:g}")
    for key, word in (("minItems", "at least {} items"), ("maxItems", "at most {} items"),
                      ("maxLength", "at most {} characters")):
        if key in schema:
            parts.append(word.format(schema[key]))
    if "default" in schema:
        parts.append(f"default {json.dumps(schema['default'])}")
    return ", ".join(parts)


def cell(text):
    return re.sub(r"\s+", " ", text).replace("|", "\\|").replace("\\\\|", "\\|")


def fields(document, schema, prefix="", depth=3):
    """Rows of a table of an object's fields, those of objects within it after theirs; nothing for what is no object."""
    schema = resolve(document, schema)
    if "anyOf" in schema:  # the first form of several, or of what may be null, is the one described
        schema = resolve(document, schema["anyOf"][0])
    required = set(schema.get("required", ()))
    rows = []
    for choice in schema.get("oneOf", ()):
        # Choices distinguished by a constant, such as the kinds of a path's segments.
        told = next((f"{key}={value['const']}" for key, value in resolve(document, choice).get("properties", {}).items()
                     if "const" in value), None)
        if told:
            rows += fields(document, choice, f"{prefix.rstrip('.')}({told}).", depth)
    for name, field in schema.get("properties", {}).items():
        if f"({name}=" in prefix:  # what told this choice apart
            continue
        full = {**resolve(document, field), **{k: v for k, v in field.items() if k != "$ref"}}
        description = cell(full.get("description", "")).rstrip(".")
        limits = bounds(full)
        rows.append(f"| `{prefix}{name}`{'' if name in required else ' (optional)'} | {kind(document, field)} | "
                    f"{description}{'; ' if description and limits else ''}{limits} |")
        inner = resolve(document, full["items"]) if "items" in full else full
        if depth > 1:
            rows += fields(document, inner, f"{prefix}{name}{'[]' if 'items' in full else ''}.", depth - 1)
    return rows


def table(title, rows):
    return [title, "", "| field | type | meaning |", "|---|---|---|", *rows, ""] if rows else []


COMMON = """## What holds for all answers

- **Digits.** Where `digits` is among the parameters, numbers with a fraction are rounded to 10 significant digits, finer than any sensor;
  `?digits=17` gives all that a double has. What is evidence or comes back to the service (raw telemetry, covariates,
  models, diagnoses) and all that is stored keeps every digit.
- **Compression.** Answers of more than 1 kB, and long lists while they are made, leave coded as zstd or gzip where `Accept-Encoding`
  has it. Not coded are event streams, and what is answered at once on the thread that serves all connections: short profiles,
  single live states, `/version`. Files of the page and `/openapi.json` are kept gzipped.
- **ETag.** What rarely changes (models and their versions, a mission with its ledger, trace and covariates, diagnoses, `/version`,
  `/openapi.json`) carries an `ETag`; a request that has it in `If-None-Match` is answered 304, without a body.
- **CSV.** Where an answer is also served as `text/csv`, `Accept: text/csv` asks for it; a header `Link` with `rel="next"` names the next page.
- **Other origins.** A page elsewhere may use the service when `http.allowed_origins` has its origin, `https://fleet.example`; it proves
  itself by a token. All other pages are refused what changes something, and their browsers keep answers from them.""".splitlines()


def example(title, content):
    """A body as the document shows it."""
    if "example" not in content:
        return []
    return [title, "", "```json", *json.dumps(content["example"], indent=2, ensure_ascii=False).splitlines(), "```", ""]


def events(document, content):
    """Rows of a table of the kinds of events of a stream."""
    kinds = content.get("schema", {}).get("contentSchema", {}).get("items", {}).get("oneOf", ())
    return [f"| `{kind['properties']['event']['const']}` | {component(kind['properties']['data'])} | {cell(kind['description'])} |" for kind in kinds]


def component(schema):
    return f"`{schema['$ref'].rsplit('/', 1)[-1]}`"


def render(document):
    lines = ["# HTTP reference", "", "Made from `schemas/openapi.json` by `http_reference.py`, which a test repeats. "
             "Errors are RFC 9457 problem documents that name the field and the constraint. `field` is a JSON pointer into the "
             "body, which begins with `/`, or else the bare name of a query or path parameter or of a header. Numbers nearer "
             "to 0 than 1e-18 are told as 0, but for raw telemetry.", "", *COMMON, ""]
    for path, item in document["paths"].items():
        for method in ("get", "put", "post", "delete"):
            if method not in item:
                continue
            operation = item[method]
            lines += [f"## {method.upper()} {path}", "", operation.get("summary", ""), ""]
            if operation.get("description"):
                lines += [operation["description"], ""]
            parameters = [resolve(document, p) for p in operation.get("parameters", item.get("parameters", []))]
            lines += table("Parameters:", [
                f"| `{p['name']}` ({p['in']}{'' if p.get('required') else ', optional'}) | {kind(document, p['schema'])} | "
                f"{cell(p.get('description', ''))}{'; ' if p.get('description') and bounds(p['schema']) else ''}"
                f"{bounds(resolve(document, p['schema']))} |" for p in parameters])
            body = resolve(document, operation.get("requestBody", {})).get("content", {})
            for media, content in body.items():
                lines += table(f"Body, `{media}`:", fields(document, content.get("schema", {})))
                lines += example("For example:", content)
            problems = [status for status in operation["responses"] if not status.startswith("2")]
            for status, response in operation["responses"].items():
                if status in problems:
                    continue
                response = resolve(document, response)
                media = ", ".join(f"`{m}`" for m in response.get("content", {})) or "no body"
                note = response.get("description", "")
                lines.append(f"Answers {status} with {media}{'' if note in ('', 'OK') else ': ' + note}.")
            lines += [f"Problems: {', '.join(problems)}." if problems else "", ""]
            for status, response in operation["responses"].items():
                if not status.startswith("2"):
                    continue
                contents = resolve(document, response).get("content", {})
                content = contents.get("application/json", {})
                lines += table(f"Fields of {status}:", fields(document, content.get("schema", {})))
                lines += example("For example, with lists cut short:", content)
                rows = events(document, contents.get("text/event-stream", {}))
                if rows:
                    lines += ["Events:", "", "| event | data, a schema of `schemas/openapi.json` | when |", "|---|---|---|", *rows, ""]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    sys.stdout.write(render(json.loads((ROOT / "schemas/openapi.json").read_text())))
