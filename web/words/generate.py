#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes C++ and the page's modules of the catalogues: generate.py FOLDER OUT_FOLDER

FOLDER holds one JSON file for each language. A key's text may hold placeholders:
  {name:type}                                  in en.json, which gives each argument its type
  {name}                                       in the other languages
  {name, plural, one {# scan} other {# scans}} by a count; # is the count
  {name, select, current {...} other {...}}    by the last part of a word's id, or by a text
Types: text, int, words (a message, such as a direction), ints, texts, list (of messages), number,
and the units of "unit" in en.json. Numbers and units may be followed by + (with sign), .N (fixed
decimals) and ! (the unit is not shown).

Refuses a text that is missing, one too many, and an argument that a text does not use.
Only files whose content changed are written, so that a new text compiles little.
"""
import json
import pathlib
import re
import sys

PLAIN_TYPES = {
    "text": "std::string_view",
    "int": "std::int64_t",
    "words": "Message",
    "ints": "std::vector<std::int64_t>",
    "texts": "std::vector<std::string>",
    "list": "std::vector<Message>",
    "number": "double",
}
# Sections without messages of the C++ sources: what describes the language, and the page's texts.
NO_MESSAGES = {"language", "unit", "page"}
UNIT_SUFFIX = {"%": "percent"}


class Refusal(Exception):
    pass


def unique(pairs):
    keys = [key for key, _ in pairs]
    for key in keys:
        if keys.count(key) > 1:
            raise Refusal(f"the key '{key}' occurs twice; keep one")
    return dict(pairs)


def flatten(node, path=""):
    for key, value in node.items():
        if not re.fullmatch(r"[A-Za-z0-9_]+|%", key):
            raise Refusal(f"{path}: a key has letters, digits and _, found '{key}'")
        here = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            yield from flatten(value, here)
        elif isinstance(value, str):
            yield here, value
        else:
            raise Refusal(f"{here}: expected a text or an object, found {value!r}")


def group_end(text, start):
    depth = 0
    for i in range(start, len(text)):
        depth += {"{": 1, "}": -1}.get(text[i], 0)
        if depth == 0:
            return i + 1
    raise Refusal(f"unbalanced braces: {text}")


class Text:
    """A text, its arguments in the order of their first use, and its writing with full types."""

    def __init__(self, where, text, types=None):
        self.where = where
        self.types = dict(types) if types is not None else None
        self.arguments = {}
        self.full = self.parse(text)
        if types is not None and set(types) != set(self.arguments):
            missing = sorted(set(types) - set(self.arguments))
            raise Refusal(f"{where}: the text does not use {missing}")

    def parse(self, text):
        if text.count("{") != text.count("}"):
            raise Refusal(f"{self.where}: unbalanced braces: {text}")
        full, i = "", 0
        while i < len(text):
            if text[i] != "{":
                full += text[i]
                i += 1
                continue
            end = group_end(text, i)
            full += self.placeholder(text[i + 1:end - 1])
            i = end
        return full

    def placeholder(self, inside):
        match = re.fullmatch(r"([a-z][A-Za-z0-9_]*)(?::([^,\s{}]+))?(?:,\s*(plural|select),\s*(.*))?",
                             inside, re.S)
        if not match:
            raise Refusal(f"{self.where}: '{{{inside}}}' is no placeholder")
        name, stated, choice, cases = match.groups()
        known = self.arguments.get(name)
        if self.types is not None:
            if stated:
                raise Refusal(f"{self.where}: only en.json gives types, found {{{inside}}}")
            if name not in self.types:
                raise Refusal(f"{self.where}: there is no argument {name}")
            kind = self.types[name]
        else:
            kind = stated or known
            if kind is None:
                raise Refusal(f"{self.where}: {{{name}}} needs a type")
        if known is None:
            self.arguments[name] = kind
        if not choice:
            return f"{{{name}:{kind}}}"
        return f"{{{name}:{kind}, {choice}, {self.cases(cases)}}}"

    def cases(self, cases):
        full, names = [], []
        while cases.strip():
            match = re.match(r"\s*([A-Za-z0-9_]+)\s*\{", cases)
            if not match:
                raise Refusal(f"{self.where}: '{cases}' is no case")
            start = match.end() - 1
            end = group_end(cases, start)
            names.append(match.group(1))
            full.append(f"{match.group(1)} {{{self.parse(cases[start + 1:end - 1])}}}")
            cases = cases[end:]
        if "other" not in names:
            raise Refusal(f"{self.where}: a choice needs the case 'other'")
        return " ".join(full)


def base_type(kind):
    return re.split(r"[+.!]", kind, maxsplit=1)[0]


def pascal(key):
    return "".join(part[:1].upper() + part[1:] for part in key.split("_"))


def literal(text):
    out = '"'
    for byte in text.encode():
        if byte in b'"\\?':
            out += "\\" + chr(byte)
        elif byte == 10:
            out += "\\n"
        elif 32 <= byte < 127:
            out += chr(byte)
        else:
            out += f"\\{byte:03o}"
    return out + '"'


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text() != content:
        path.write_text(content)


def parameter(name, kind, units):
    kind = base_type(kind)
    if kind in PLAIN_TYPES:
        value = {"text": f"std::string({name})", "number": f'Quantity{{{name}, ""}}',
                 "int": name}.get(kind, f"std::move({name})")
        return f"{PLAIN_TYPES[kind]} {name}", value
    if kind not in units:
        raise Refusal(f"{name}: unknown type or unit '{kind}'")
    suffixed = f"{name}_{UNIT_SUFFIX.get(kind, kind.lower())}"
    return f"double {suffixed}", f"Quantity{{{suffixed}, {literal(kind)}}}"


def section_header(section, texts, units):
    parts = [f"// Made of web/words/en.json by web/words/generate.py: section \"{section}\".\n"
             "#pragma once\n\n#include <utility>\n\n#include \"algo/base/message.hpp\"\n\n"
             f"namespace plumb::say::{section} {{\n"]
    for key, text in texts:
        name = pascal(key)
        try:
            both = [parameter(n, k, units) for n, k in text.arguments.items()]
        except Refusal as refusal:
            raise Refusal(f"{text.where}: {refusal}") from None
        rows = ", ".join(f"{{\"{n}\", {value}}}" for n, (_, value) in zip(text.arguments, both))
        comment = text.full.replace("\n", " ")
        parts.append(
            f"\ninline constexpr MessageId k{name}{{\"{section}.{key}\"}};\n"
            f"/// {comment}\n"
            f"[[nodiscard]] inline Message {name}({', '.join(p for p, _ in both)}) {{\n"
            f"  return {{k{name}, {{{rows}}}}};\n}}\n")
    parts.append(f"\n}}  // namespace plumb::say::{section}\n")
    return "".join(parts)


def catalogue_source(code, about, texts):
    rows = "".join(f"    {{{literal(key)}, {literal(text.full)}}},\n"
                   for key, text in sorted(texts.items(), key=lambda item: item[0].encode())
                   if not key.startswith("page."))
    return (
        f"// Made of web/words/{code}.json by web/words/generate.py.\n"
        '#include "algo/base/message.hpp"\n\nnamespace plumb {\nnamespace {\n\n'
        f"constexpr std::pair<std::string_view, std::string_view> kTexts_{code}[] = {{\n" + rows + "};\n"
        f"constexpr Catalogue kCatalogue_{code} = {{{literal(code)}, {literal(about['name'])}, "
        f"{literal(about['locale'])},\n                                  "
        f"'{about['decimal']}', {'true' if about['plural'] == 'zero_is_one' else 'false'}, kTexts_{code}}};\n"
        "\n}  // namespace\n\n"
        f"const Catalogue& CatalogueFor_{code}() {{ return kCatalogue_{code}; }}\n"
        + ("const Catalogue& EnglishCatalogue() { return kCatalogue_en; }\n" if code == "en" else "")
        + "\n}  // namespace plumb\n")


def list_source(codes):
    declared = "".join(f"const Catalogue& CatalogueFor_{code}();\n" for code in codes)
    return ("// Made by web/words/generate.py.\n#include <algorithm>\n\n"
            '#include "algo/base/message.hpp"\n\nnamespace plumb {\n' + declared +
            "\nstd::span<const Catalogue* const> Catalogues() {\n"
            "  static const Catalogue* const all[] = {"
            + ", ".join(f"&CatalogueFor_{code}()" for code in codes) + "};\n  return all;\n}\n\n"
            "const Catalogue* FindCatalogue(std::string_view code) {\n"
            "  const auto all = Catalogues();\n"
            "  const auto found = std::find_if(all.begin(), all.end(), [&](const Catalogue* one) "
            "{ return one->code == code; });\n"
            "  return found == all.end() ? nullptr : *found;\n}\n\n}  // namespace plumb\n")


def read_language(path, english=None):
    def read(file):
        try:
            return json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=unique)
        except (ValueError, Refusal) as error:
            raise Refusal(f"{file.name}: {error}") from None
    tree = read(path)
    about = tree.get("language", {})
    for key in ("name", "locale", "decimal", "plural"):
        if key not in about:
            raise Refusal(f"{path.name}: language.{key} is missing")
    entries = {key: text for key, text in flatten(tree) if not key.startswith("language.")}
    texts, wrong = {}, []
    for key, text in entries.items():
        if english is not None and key not in english:
            wrong.append(f"{path.name}: {key} is not in en.json")
            continue
        try:
            if key.startswith("unit."):
                if "{value}" not in text:
                    raise Refusal(f"{path.name}: {key} needs {{value}}")
                texts[key] = type("Unit", (), {"full": text, "arguments": {}})
                continue
            texts[key] = Text(f"{path.name}: {key}", text,
                              None if english is None else english[key].arguments)
        except Refusal as refusal:
            wrong.append(str(refusal))
    if english is not None:
        wrong += [f"{path.name}: {key} is missing" for key in english if key not in entries]
    if wrong:
        raise Refusal("\n".join(wrong))
    return tree, about, texts


def main(folder, out):
    english_tree, about, english = read_language(folder / "en.json")
    units = set(english_tree.get("unit", {}))
    codes = ["en"] + sorted(p.stem for p in folder.glob("*.json") if p.stem != "en")
    read = {"en": (about, english)}
    refusals = []
    for code in codes[1:]:
        try:
            _, other_about, texts = read_language(folder / f"{code}.json", english)
            read[code] = (other_about, texts)
        except Refusal as refusal:
            refusals.append(str(refusal))
    if refusals:
        raise Refusal("\n".join(refusals))
    for section, node in english_tree.items():
        if section in NO_MESSAGES:
            continue
        if any(not isinstance(text, str) for text in node.values()):
            raise Refusal(f"en.json: {section} holds an object; messages are not nested")
        texts = [(key, english[f"{section}.{key}"]) for key in node]
        write(out / "words" / f"{section}.hpp", section_header(section, texts, units))
    for code in codes:
        about, texts = read[code]
        write(out / f"words_{code}.cpp", catalogue_source(code, about, texts))
        # The page calls its texts with their arguments in the order of the English text.
        page = {"language": about, "texts": {key: text.full for key, text in texts.items()},
                "arguments": {key: text.arguments for key, text in english.items()
                              if key.startswith("page.") and text.arguments}}
        write(out / "page" / f"{code}.json", json.dumps(page, ensure_ascii=False, indent=0) + "\n")
    write(out / "words_list.cpp", list_source(codes))
    write(out / "stamp", "\n".join(codes) + "\n")


if __name__ == "__main__":
    try:
        main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
        (pathlib.Path(sys.argv[2]) / "stamp").touch()
    except Refusal as refusal:
        sys.exit(f"web/words: {refusal}")
