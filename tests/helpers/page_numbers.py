"""Numbers in documents: which of them are neither drawn from records nor defined.

The rule, for every document but the notebook (``results/notebook*.md``). A number in digits is one of three:

1. measured: drawn from kept records, between ``<!-- drawn: NAME FOLDER -->`` and ``<!-- end -->``;
2. code: what one types or a program says, in a block or in backticks. A decimal number alone is not code, nor is one with
   a unit of what is measured;
3. a definition, in a form that no measured number has: a power (2^-30, 1e7), a multiple of the rounding unit u, a size
   (256x256), a year, a name (Table 1), the number of a list; the default of a parameter, which is compared with the code;
   or it stands in ``tests/data/definitions.toml``, with the word after it and a reason.

Whatever is left is measured, and has no record. Number words ("three times") count where a unit follows them.
"""

import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from shadowbench.harness.frame.registry import method_class, method_names, parameters
from shadowbench.harness.report.documents import PART

ROOT = Path(__file__).resolve().parents[2]
LISTED = Path(__file__).resolve().parents[1] / "data" / "definitions.toml"

UNIT = (
    r"(?:ms|us|ns|s|%|x|per cent|seconds?|minutes?|hours?|times|frames a second|wrong|errors?|of its answers|"
    r"[kMG]i?B|bytes|registers|instructions|Mrays/s)(?!\w)"
)
WORDS = (
    "half third quarter two three four five six seven eight nine ten eleven twelve fifteen twenty thirty forty fifty sixty "
    "hundred thousand million twice thrice"
)
SPOKEN = re.compile(
    rf"\b(?:{WORDS.replace(' ', '|')})(?:\s+an?|\s+of a)?\s+"
    rf"(?:{UNIT}|as (?:long|fast|many|much)|of the (?:time|frame))"
)
NUMBER = re.compile(
    r"(?<![\w.^#/])(?<![A-Za-z]-)[-+~]?\d(?:[\d,.]*\d)?(?:e[-+]?\d+|\^-?\d+)?(?:-bit|[A-Za-z]*)(?![\d^])"
)
NEXT = re.compile(r"\s*([^\s|]*)")
"""The word after a number, in the same cell of a table."""

CODE = re.compile(r"```.*?```|`[^`]*`", re.DOTALL)
NOT_CODE = re.compile(rf"(?<![\w.])\d[\d,.]* ?{UNIT}|{SPOKEN.pattern}|^`[-+~]?[\d,]*\.\d+`$")
ADDRESS = re.compile(r"\]\([^)]*\)|https?://\S+|\b\d+\.\d+\.\d+(?:\.\d+)?\b|\(\d{4}-\d\d-\d\d\)")
"""Where a link leads, the number of a version or of a host, and the day of a release."""

NAMES = "[Tt]able [Ff]igures? [Ss]ections? [Cc]hapter [Aa]lgorithm GTX Embree Python Apache CUDA glTF TOG uPlot H100"
NAMED = re.compile(rf"(?:\b(?:{NAMES.replace(' ', '|')})|§) \d[\d.]*(?:, \d[\d.]*)*(?: and \d+)?(?![\d%])")
SIZE = re.compile(rf"\b\d+(?: ?x ?\d+)+\b(?!\s*{UNIT})")
PLACE = re.compile(r"^ *\d+\. ", re.MULTILINE)
DEFINED = re.compile(
    rf"""(?x)
    (?:-?\d+(?:\.\d+)?e[-+]?\d+|\d+\^-?\d+)(?!\s*{UNIT.replace(" ", "[ ]")})     # a power
    | \d+(?:\.\d+)?[ ]u\b                                                         # of the rounding unit
    | (?:19[6-9]|20[0-2])\d(?![\d,.]*\d)(?!\s*{UNIT.replace(" ", "[ ]")})         # a year
    | \d+-bit\b | 3MF | 3D | 3ds | 4D
    """
)

DEFAULT = re.compile(r"`(\w+)` \((-?\d[\d.]*)\)")
"""A parameter with its default: "`small` (64)"."""
BOLD_DEFAULT = re.compile(r"^\|[^|]*\| (`\w+`(?:, `\w+`)*) \|[^|]*?\*\*([\w+-]+)\*\*[^|]*\|$", re.MULTILINE)
"""A row of a table with parameters and, in bold, their default."""


def pages() -> list[Path]:
    """Every document that follows the rule: all but the notebook, and the reports that are drawn as a whole."""
    folders = [ROOT, ROOT / "results", *(path for path in (ROOT / "results").iterdir() if path.is_dir())]
    readmes = [*ROOT.glob("*/README.md"), *(path for folder in folders for path in folder.glob("README.md"))]
    return sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *readmes})


@cache
def listed() -> dict[str, dict[str, list[str]]]:
    """The definitions of each page by their reason."""
    return tomllib.loads(LISTED.read_text(encoding="utf-8"))


@cache
def defaults() -> dict[str, set[str]]:
    """The default values of all parameters of all methods, by name, as a page writes them: "5" for 5.0."""
    found: dict[str, set[str]] = {}
    for name in method_names():
        for one in parameters(method_class(name)):
            text = f"{one.default:g}" if isinstance(one.default, float) else str(one.default).lower()
            found.setdefault(one.name, set()).add(text)
    return found


def numbers(text: str) -> Iterator[str]:
    """The numbers of a page that are not drawn, not code, and in no form that only definitions have; with the next word."""
    text = PART.sub("", text)
    for code in CODE.findall(text):
        yield from NOT_CODE.findall(code)
    text = CODE.sub("¤", ADDRESS.sub("] ", BOLD_DEFAULT.sub(in_bold, DEFAULT.sub(in_brackets, text))))
    text = PLACE.sub("", NAMED.sub("N", SIZE.sub("N", text)))
    yield from (" ".join(spoken.split()) for spoken in SPOKEN.findall(text))
    for found in NUMBER.finditer(text):
        if not DEFINED.match(text, found.start()):
            word = NEXT.match(text, found.end())[1].rstrip(".,;:)").strip("*\"'")
            yield f"{found[0]} {word}".strip()


def in_brackets(found: re.Match[str]) -> str:
    """A parameter with its default, without it where the code has it."""
    return "¤" if found[2] in defaults().get(found[1], ()) else found[0]


def in_bold(found: re.Match[str]) -> str:
    """A row of :data:`BOLD_DEFAULT`, without the default where the code has it."""
    right = all(value in defaults().get(name, ()) for name, value in bold_defaults(found[0]))
    return found[0].replace(f"**{found[2]}**", "¤") if right else found[0]


def bold_defaults(text: str) -> list[tuple[str, str]]:
    """The parameters of the rows of :data:`BOLD_DEFAULT`, each with what is called its default."""
    return [(name, value) for names, value in BOLD_DEFAULT.findall(text) for name in re.findall(r"`(\w+)`", names)]


def undrawn(name: str, text: str) -> list[str]:
    """The numbers of a page that are measured, by the rule, and not drawn."""
    known = {number for own in listed().get(name, {}).values() for number in own}
    return [number for number in numbers(text) if number not in known]


def unused(name: str, text: str) -> list[str]:
    """What is listed of a page and does not stand there."""
    there = set(numbers(text))
    return [number for own in listed().get(name, {}).values() for number in own if number not in there]
