"""Damage to files and to values of JSON, drawn from a seeded generator."""

import copy
import struct
from random import Random
from typing import Any

WORDS = [
    b"nan", b"-inf", b"1e400", b"-1e-400", b"0", b"-1", b"1_0", b"0x10", b"2147483648", b"99999999999999999999", b"1e5",
    b"", b" ", b"\t", b"\n", b"\r", b"\\\n", b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3\x28", b"/", b"//", b"#", b"[", b"{",
    b'"', b"null", b"@a.usda@", b"../../x", b"\x1b[31m", "\u0661".encode(), "\u202e".encode(),
]  # fmt: skip

NUMBERS = (0, 1, 2, 3, 4, 255, 65535, 1 << 31, (1 << 32) - 1)

VALUES: list[Any] = [
    None, True, False, 0, 1, -1, 1 << 31, 1 << 62, 10**30, 0.5, -0.0, 1e300, float("nan"), float("inf"), "",
    "a", "../a", "a/b", "\x1b[31m", "\ud800", "\u202e", "<b>", "$x$", "|", "nan", "ok", "cuda:0", [], [[]], [1], [None],
    ["a"], {}, {"a": 1},
    {"": []}, "x" * 5000, [0] * 5000,
]  # fmt: skip


def damaged(rng: Random, blob: bytes, others: list[bytes]) -> bytes:
    """The file after a few mutations. ``others``: files to take parts of."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(blob) + 1)
        to = min(len(blob), at + int(rng.expovariate(1 / 30)))
        kind = rng.randrange(10)
        if kind == 0:
            blob = blob[:at]
        elif kind == 1 and blob:
            at = min(at, len(blob) - 1)
            blob = blob[:at] + bytes([blob[at] ^ (1 << rng.randrange(8))]) + blob[at + 1 :]
        elif kind == 2:
            start = max(blob.rfind(blank, 0, at) for blank in (b" ", b"\n")) + 1
            ends = [i for i in (blob.find(b" ", at), blob.find(b"\n", at)) if i >= 0]
            blob = blob[:start] + rng.choice(WORDS) + blob[min(ends, default=len(blob)) :]
        elif kind == 3:
            blob = blob[:at] + rng.choice(WORDS) + blob[at:]
        elif kind == 4:
            blob = blob[:at] + struct.pack("<I", rng.choice(NUMBERS)) + blob[at + 4 :]
        elif kind == 5:
            blob = blob[:at] + blob[to:]
        elif kind == 6:
            blob = blob[:to] + blob[at:to] * rng.choice((1, 2, 50)) + blob[to:]
        elif kind == 7:
            other = rng.choice(others)
            cut = rng.randrange(len(other) + 1)
            blob = blob[:at] + other[cut : cut + rng.randrange(1, 200)] + blob[to:]
        elif kind == 8:
            blob = blob[:at] + rng.randbytes(to - at) + blob[to:]
        else:
            blob = rng.choice((blob.replace(b"\n", b"\r\n"), blob.replace(b"\n", b"\r"), blob.replace(b" ", b"\t")))
    return blob


def changed(rng: Random, value: Any) -> Any:
    """A value of JSON with a few odd values in the places of others, and with fields that are gone, new or renamed."""
    value = copy.deepcopy(value)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = list(_places(value))
        if not places:
            return rng.choice(VALUES)
        holder, key = rng.choice(places)
        kind = rng.randrange(6)
        if kind == 0:
            del holder[key]
        elif kind == 1 and isinstance(holder, dict):
            holder[rng.choice(("", "a", "\x1b", "\ud800", "name", "run", "label"))] = rng.choice(VALUES)
        elif kind == 2:
            other, place = rng.choice(places)
            if place in other if isinstance(other, dict) else place < len(other):
                holder[key] = copy.deepcopy(other[place])
        elif kind == 3 and isinstance(holder, list):
            holder.insert(key, copy.deepcopy(rng.choice(VALUES)))
        else:
            holder[key] = copy.deepcopy(rng.choice(VALUES))
    return value


def _places(value: Any) -> Any:
    for key, one in list(value.items()) if isinstance(value, dict) else enumerate(list(value)):
        yield value, key
        if isinstance(one, dict | list):
            yield from _places(one)
