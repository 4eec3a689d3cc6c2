"""What counts as the code of a file: its syntax, and no comment, docstring or layout."""

import hashlib
import io
import tokenize

import pytest
from hypothesis import given, settings, strategies
from shadowbench.harness.runner.source.closure import code_of

SAMPLE = r'''
"""Doc of the module."""  # a comment
import warp as wp

WIDTH: int = 0x1F + 1_000  # of "what"
"""Doc of WIDTH."""
TEXT = "# no comment", 'é"#"', b"#", r"\#", """two

  lines # no comment
"""
"éDoc"; PLACE = "é"; "Doc after two bytes"  # columns of a syntax tree count bytes
NAMES = f"{WIDTH!r:>{WIDTH}} # {TEXT[0]}" f"""{
    WIDTH}

  # in the text"""
π℘ = 1


@wp.func_native(snippet="""
// return #
return a;
""")
def native(a: int) -> int: ...


@wp.kernel(enable_backward=False)
def kernel(values: wp.array(dtype=wp.float32)):
    """Doc
    with # and '."""
    i = wp.tid()  # per value
    if wp.static(WIDTH > 1): values[i] = 1.0; values[i] *= 2.0
    else:
        values[i] = \
            -1.0

    ("a string", "that counts")


class Empty:
    """Doc alone."""


class Full:
    ("Doc "
     "Doc in two parts")  # and a comment
    x: int = 1; "Doc of x"
    """Doc of x again"""

    def get(self): "Doc in one line"

    async def wait(self):
        # first a comment
        'Doc'
        b"of bytes"
        return [self.x,
                # between
                not -1 ** 2]
'''


def code(text: str) -> bytes:
    found = code_of(text.encode())
    assert not found.startswith(b"whole"), text
    return found


def test_the_code_is_the_same_under_every_python():
    """A record that one version of Python made is current for another."""
    assert hashlib.sha256(code(SAMPLE)).hexdigest()[:16] == "35a076fdd1d400a0"


@pytest.mark.parametrize(
    ("old", "new", "counts"),
    [
        ('"éDoc"; PLACE', "PLACE", False),
        ('; "Doc after two bytes"', "", False),
        ('"Doc in one line"', '"in a line"', False),
        ("return [self.x,", "return [ self.x, # kept", False),
        ("\\\n            -1.0", "-1.0", False),
        ("\n", "\r\n", False),
        ("  lines # no comment\n", "  lines\n", True),
        ("two\n", "two \n", True),
        ("// return #", "// return", True),
        ("\n\n  # in the text", "\n  # in the text", True),
        ('("a string", "that counts")', '"a string" "that counts"', True),
        ("1.0; values[i] *=", "1.0\n    values[i] *=", True),
        ("    async def wait(self)", "async def wait(self)", True),
        ("@wp.kernel(enable_backward=False)\n", "", True),
    ],
)
def test_layout_does_not_count_and_what_a_program_sees_does(old, new, counts):
    assert old in SAMPLE
    assert (code_of(SAMPLE.replace(old, new).encode()) != code(SAMPLE)) == counts


def tokens(text: str) -> list[tokenize.TokenInfo]:
    return list(tokenize.generate_tokens(io.StringIO(text).readline))


def test_every_token_counts():
    """Each name and number changed, each operator left out, each string made longer; docstrings alone do not count."""
    lines, before, ignored, docstrings = SAMPLE.split("\n"), code(SAMPLE), [], []
    for token in tokens(SAMPLE):
        (line, start), (last, end), own = token.start, token.end, token.string
        changed = {"NAME": f"{own}_", "NUMBER": f"{own}1", "OP": " ", "STRING": f'{own} "x"'}
        new = changed.get(tokenize.tok_name[token.type])
        if new is None:
            continue
        docstrings += [own] if "Doc" in own else []
        edited = [*lines[: line - 1], lines[line - 1][:start] + new + lines[last - 1][end:], *lines[last:]]
        if code_of("\n".join(edited).encode()) == before:
            ignored.append(own)
    assert ignored == docstrings


@pytest.mark.parametrize("source", [b"x = (", b"x = 1\n  y = 2", b"x = '\xff'", b"# coding: none\n", b"x = 1\0"])
def test_of_a_file_that_cannot_be_read_every_byte_counts(source):
    assert code_of(source) == b"whole\0" + source


def test_the_text_counts_and_not_how_it_is_encoded():
    latin = "# coding: latin-1\nx = 'é'".encode("latin-1")
    assert code_of(latin) == code("x = 'é'") == code("\ufeffx = 'é'")


BLOCKS = ("x = 1", "s = 'a # b'", "if x:\n    y = f'{x}#'", "class A:\n    n: int = 1", "def f(a):\n    return a",
          "t = (1,\n     2)", "for i in s:\n    x += 1\n\n    y = 2")  # fmt: skip
NOTES = ("# {0}", "", "   ", '"""{0}\n{0}"""', "'{0}'", "('{0}' # c\n '{0}')", "'{0}';")
WORDS = strategies.text(alphabet="ab #é", max_size=5)


@given(strategies.lists(strategies.sampled_from(BLOCKS), min_size=1, max_size=4), strategies.data())
@settings(max_examples=60, deadline=None)
def test_comments_and_docstrings_anywhere_do_not_count(blocks, data):
    """Before every line of a program comments, docstrings and blank lines are inserted, and comments after it."""
    noted = []
    for line in "\n".join(blocks).split("\n"):
        in_brackets = line.startswith("     ")  # only a comment can be there
        choices = strategies.sampled_from(NOTES[:3] if in_brackets else NOTES)
        indent = line[: len(line) - len(line.lstrip())]
        for note in data.draw(strategies.lists(choices, max_size=2)) if line else ():
            noted += [indent + part for part in note.format(data.draw(WORDS)).split("\n")]
        noted.append(line + data.draw(strategies.sampled_from(("", "  ", " # it's"))))
    assert code("\n".join(noted)) == code("\n".join(blocks))
