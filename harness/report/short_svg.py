"""A drawing of matplotlib as SVG in about half of its bytes: the same elements, texts and looks.

Most bytes of a drawing are looks that hundreds of its elements repeat, digits of coordinates beyond a hundredth of a point,
and indentation.
"""

import re
from collections import Counter

TAG = re.compile(r"<[^!?>][^>]*>")
STYLE = re.compile(r' style="([^"]*)"')
NUMBER = re.compile(r"-?\d+\.\d{3,}")
RULES = "</style>"  # where further rules of style are put: matplotlib writes one element of them


def short(drawing: str) -> str:
    """The drawing with a class for each style that several elements have, coordinates to a hundredth of a point, and
    neither indentation nor line ends within elements."""
    styles = Counter(STYLE.findall(drawing)) if RULES in drawing else Counter()
    classes = {style: f"s{i}" for i, style in enumerate(style for style, count in styles.items() if count > 1)}

    def look(found: re.Match[str]) -> str:
        return f' class="{classes[found[1]]}"' if found[1] in classes else found[0]

    def tag(found: re.Match[str]) -> str:
        before, *style = re.split(r'( style="[^"]*")', re.sub(r"\s*\n\s*", " ", found[0]), maxsplit=1)
        whole = [NUMBER.sub(lambda number: f"{float(number[0]):.2f}", part) for part in (before, *style[1:])]
        return STYLE.sub(look, "".join([whole[0], *style[:1], *whole[1:]]))

    rules = "".join(f".{name}{{{style}}}" for style, name in classes.items())
    return re.sub(r">\n\s+<", ">\n<", TAG.sub(tag, drawing)).replace(RULES, rules + RULES, 1)
