"""Compares the constants of src/gap with the table of method.md, which states the source of each.
usage: check_constants.py SOURCE (the project's folder)"""
import pathlib
import re
import sys

NUMBER = re.compile(r"(?<![\w.])-?(?:\d[\d']*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
# Names, each with its value; braces are lists.
DECLARED = re.compile(r"\bconstexpr\s+(?:double|int|std::size_t|Bounds|auto|std::array(?:<[^>;]*>)?)\s+([^;]*);")
ONE = re.compile(r"(\w+)\s*(?:=\s*|(?=\{))((?:\{[^;]*\}|[^,{};])+)")


def numbers(text):
    return [float(n.replace("'", "")) for n in NUMBER.findall(text)]


def constants(folder):
    """(file, name, numbers) of every constexpr number; texts and tables of structs are left out."""
    for file in sorted([*folder.rglob("*.h"), *folder.rglob("*.cc")]):
        code = re.sub(r"//[^\n]*", "", file.read_text())
        for declared in DECLARED.findall(code):
            if '"' in declared or "to_array" in declared or "::" in declared:
                continue
            for name, value in ONE.findall(declared):
                if numbers(value):
                    yield file.name, name, numbers(value)


def rows(text):
    """(names, numbers of the values) of each row of the table of constants."""
    table = text.split("## Constants", 1)[1].split("\n## ", 1)[0]
    for line in table.splitlines():
        cells = line.split("|")
        if len(cells) > 4 and "`" in cells[1]:
            yield re.findall(r"`(\w+)`", cells[1]), numbers(cells[2])


def main():
    source = pathlib.Path(sys.argv[1])
    table = {name: values for names, values in rows((source / "tests/study/method.md").read_text()) for name in names}
    code = list(constants(source / "src/gap"))
    wrong = [f"{name} of the table is not in the code" for name in table if name not in {own for _, own, _ in code}]
    wrong += [f"{file}: {name} = {value}, in its row of the table {table.get(name)}" for file, name, value in code
              if not set(value) <= set(table.get(name, ()))]
    print("\n".join(wrong) or f"{len(code)} constants agree")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
