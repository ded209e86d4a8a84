"""Writes the reference that the daemon serves at /reference: HTTP, settings and effects.

    reference.py SCHEMAS EFFECTS_MARKDOWN > reference.html

SCHEMAS is the folder of openapi.json and config.schema.json, EFFECTS_MARKDOWN the program that prints the catalogue.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import markdown


METHODS = ["get", "put", "post", "delete"]


def component(schema):
    return schema["$ref"].rsplit("/", 1)[-1]


def resolve(document, schema):
    while "$ref" in schema:
        node = document
        for part in schema["$ref"].split("/")[1:]:
            node = node[part]
        schema = node
    return schema


def kind(document, schema):
    name = component(schema) if "$ref" in schema else None
    schema = resolve(document, schema)
    if "enum" in schema:
        return " \\| ".join(f"`{'null' if value is None else value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    for word in ("oneOf", "anyOf"):
        if word in schema and "properties" not in schema:
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


def described(words, schema):
    return "; ".join(filter(None, (cell(words), bounds(schema))))


def fields(document, schema, prefix="", depth=3):
    """Returns the rows of a table of an object's fields, each followed by those of its own fields; none for other types."""
    schema = resolve(document, schema)
    if "anyOf" in schema and "properties" not in schema:  # of several forms, or of a nullable one, the first is described
        schema = resolve(document, schema["anyOf"][0])
    required = set(schema.get("required", ()))
    rows = []
    for choice in schema.get("oneOf", ()):
        # Choices distinguished by a constant, such as the kinds of a path's segments.
        constant = next((f"{key}={value['const']}" for key, value in resolve(document, choice).get("properties", {}).items()
                         if "const" in value), None)
        if constant:
            rows += fields(document, choice, f"{prefix.rstrip('.')}({constant}).", depth)
    for name, field in schema.get("properties", {}).items():
        if f"({name}=" in prefix:  # the constant of this choice
            continue
        full = {**resolve(document, field), **{k: v for k, v in field.items() if k != "$ref"}}
        rows.append(f"| `{prefix}{name}`{'' if name in required else ' (optional)'} | {kind(document, field)} | "
                    f"{described(full.get('description', '').rstrip('.'), full)} |")
        inner = resolve(document, full["items"]) if "items" in full else full
        if depth > 1:
            rows += fields(document, inner, f"{prefix}{name}{'[]' if 'items' in full else ''}.", depth - 1)
    return rows


def table(title, rows):
    return [title, "", "| field | type | meaning |", "|---|---|---|", *rows, ""] if rows else []


COMMON = """## All answers

- **Digits.** Operations with the parameter `digits` round fractional numbers to 10 significant digits by default; `?digits=17` returns
  every digit of a double. Raw telemetry, covariates, models, diagnoses and all stored values keep every digit.
- **Compression.** Answers of more than 1 kB, and long lists while they are written, are coded as zstd or gzip according to
  `Accept-Encoding`. Event streams and brief answers (short profiles, single live states, `/version`) are not. Files of the page and
  `/openapi.json` are stored gzipped.
- **ETag.** Answers that rarely change (models and their versions, a mission with its ledger, trace and covariates, diagnoses, `/version`,
  `/openapi.json`) have an `ETag`; a request with it in `If-None-Match` is answered 304, without a body.
- **CSV.** `Accept: text/csv` requests a table from operations that serve it; the header `Link` with `rel="next"` names the next page.
- **Other origins.** Pages of other origins may read answers where `http.allowed_origins` lists them.
- **Former names.** Paths and members of the version before are answered with the header `Deprecation`; the change log lists them.""".splitlines()


def example(title, content):
    """Returns the lines of a body's example."""
    if "example" not in content:
        return []
    return [title, "", "```json", *json.dumps(content["example"], indent=2, ensure_ascii=False).splitlines(), "```", ""]


def events(content):
    """Returns the rows of a table of a stream's events."""
    kinds = content["schema"]["contentSchema"]["items"]["oneOf"] if content else ()
    return [f"| `{kind['properties']['event']['const']}` | `{component(kind['properties']['data'])}` | {cell(kind['description'])} |" for kind in kinds]


def render(document):
    lines = ["# HTTP", "", "The OpenAPI document is at [`/openapi.json`](/openapi.json). "
             "Errors are RFC 9457 problem documents that name the field and the constraint. `field` is a JSON pointer into the "
             "body, beginning with `/`, or the name of a query or path parameter or of a header. Numbers nearer "
             "to 0 than 1e-18 are written as 0, except in raw telemetry.", "", *COMMON, ""]
    for path, item in document["paths"].items():
        for method in sorted(item, key=METHODS.index):
            operation = item[method]
            lines += [f"## {method.upper()} {path}", "", operation["summary"], ""]
            lines += table("Parameters:", [
                f"| `{p['name']}` ({p['in']}{'' if p['required'] else ', optional'}) | {kind(document, p['schema'])} | "
                f"{described(p['description'], p['schema'])} |" for p in operation.get("parameters", [])])
            for media, content in operation.get("requestBody", {}).get("content", {}).items():
                lines += table(f"Body, `{media}`:", fields(document, content.get("schema", {})))
                lines += example("For example:", content)
            (status, success), *problems = operation["responses"].items()
            contents = success.get("content", {})
            media = ", ".join(f"`{m}`" for m in contents) or "no body"
            note = success["description"]
            lines.append(f"Answers {status} with {media}{'' if note == 'OK' else ': ' + note}.")
            lines += [f"Problems: {', '.join(problem for problem, _ in problems)}.", ""]
            content = contents.get("application/json", {})
            lines += table(f"Fields of {status}:", fields(document, content.get("schema", {})))
            lines += example("For example, with lists cut short:", content)
            rows = events(contents.get("text/event-stream", {}))
            if rows:
                lines += ["Events:", "", "| event | data, a schema of `schemas/openapi.json` | when |", "|---|---|---|", *rows, ""]
    return "\n".join(lines).rstrip() + "\n"


def settings(schema):
    lines = ["# Settings", "", "A setting `http.port` is the flag `--http-port`, the environment variable "
             "`JOULECAST_HTTP_PORT`, and in a settings file the member `port` of `http`.", "", "| setting | type | meaning |",
             "|---|---|---|"]
    for group, members in schema["properties"].items():
        for name, setting in members.get("properties", {}).items():
            kind = " \\| ".join(f"`{v}`" for v in setting["enum"]) if "enum" in setting else setting["type"]
            lines.append(f"| `{group}.{name}` | {kind} | {described(setting['description'], setting)} |")
    return "\n".join(lines) + "\n"


PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>joulecast reference</title>
<link rel="stylesheet" href="reference.css">
{contents}
{body}
</html>
"""


def main(schemas, effects):
    read = lambda name: json.loads((Path(schemas) / name).read_text())
    text = "\n".join((render(read("openapi.json")), settings(read("config.schema.json")),
                      subprocess.run([effects], check=True, capture_output=True, text=True).stdout))
    converter = markdown.Markdown(extensions=["tables", "fenced_code", "sane_lists", "toc"],
                                  extension_configs={"toc": {"toc_depth": "1-3"}})
    body = converter.convert(text)
    sys.stdout.write(PAGE.format(contents=converter.toc, body=body))


if __name__ == "__main__":
    main(*sys.argv[1:])
