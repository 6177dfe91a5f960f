"""check_xapi.py FILE COUNT: the file has COUNT statements, a line each, that keep to the structure of xAPI
1.0.3 (part two, sections 2.2 to 2.4 and 4): no member beyond those of the specification, none missing, each of
its type and form."""
import json
import re
import sys

UUID = r"[0-9a-f]{8}-[0-9a-f]{4}-[1-5][0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}"
IRI = r"[a-z][a-z0-9+.-]*:[^\s<>\"{}|\\^`]+"
DURATION = r"P(\d+W|(?=.)(\d+Y)?(\d+M)?(\d+D)?(T(?=\d)(\d+H)?(\d+M)?(\d+(\.\d+)?S)?)?)"
STAMP = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)"


def text(pattern=r".+"):
    def check(value, where):
        assert isinstance(value, str) and re.fullmatch(pattern, value, re.S), f"{where}: {value!r}"

    return check


def number(low, high):
    def check(value, where):
        assert isinstance(value, (int, float)) and not isinstance(value, bool), f"{where}: {value!r}"
        assert low <= value <= high, f"{where}: {value!r}"

    return check


def boolean(value, where):
    assert isinstance(value, bool), f"{where}: {value!r}"


def language_map(value, where):
    assert isinstance(value, dict) and value, f"{where}: {value!r}"
    for key, words in value.items():
        assert re.fullmatch(r"[a-z]{2,3}(-[A-Za-z0-9]+)*", key), f"{where}: {key}"
        text()(words, f"{where}.{key}")


def extensions(value, where):
    assert isinstance(value, dict), where
    for key in value:
        text(IRI)(key, where)


def record(required, optional):
    def check(value, where):
        assert isinstance(value, dict), f"{where} is no object"
        assert not required.keys() - value.keys(), f"{where} lacks {required.keys() - value.keys()}"
        known = required | optional
        for key, member in value.items():
            assert key in known, f"{where} has {key}"
            assert member is not None, f"{where}.{key} is null"
            known[key](member, f"{where}.{key}")

    return check


account = record({"homePage": text(IRI), "name": text()}, {})
agent = record({"account": account}, {"objectType": text("Agent"), "name": text()})
verb = record({"id": text(IRI)}, {"display": language_map})
definition = record({}, {"name": language_map, "description": language_map, "type": text(IRI), "moreInfo": text(IRI), "extensions": extensions})
activity = record({"id": text(IRI)}, {"objectType": text("Activity"), "definition": definition})
score = record({}, {"scaled": number(-1, 1), "raw": number(-1e9, 1e9), "min": number(-1e9, 1e9), "max": number(-1e9, 1e9)})
result = record({}, {"score": score, "success": boolean, "completion": boolean, "response": text(), "duration": text(DURATION), "extensions": extensions})
context = record({}, {"platform": text(), "language": text(r"[a-z]{2,3}"), "registration": text(UUID), "extensions": extensions})
statement = record(
    {"actor": agent, "verb": verb, "object": activity, "id": text(UUID)},
    {"result": result, "context": context, "timestamp": text(STAMP)},
)

with open(sys.argv[1], encoding="utf-8") as file:
    found = [json.loads(line) for line in file if line.strip()]
for i, one in enumerate(found):
    statement(one, f"statement {i + 1}")
    points = one["result"].get("score")
    if points:
        assert points["min"] <= points["raw"] <= points["max"], f"statement {i + 1}: {points}"
assert len({one["id"] for one in found}) == len(found) == int(sys.argv[2]), f"{len(found)} statements"
