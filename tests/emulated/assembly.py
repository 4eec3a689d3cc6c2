"""The assembly of native snippets as C++, and their shared variables."""

import re

_FLOAT4 = "{{{{ float4 v = emulated_shared<float4>({{{}}}); {{0}} = v.x; {{1}} = v.y; {{2}} = v.z; {{3}} = v.w; }}}}"
_THREE = "if (({{4}}) >= 0) {{{{ {0}* to = ({0}*)({{0}}); to[0] = {{1}}; to[1] = {{2}}; to[2] = {{3}}; }}}}"

INSTRUCTIONS = {
    "cp.async.cg.shared.global [%0], [%1], 16, %2;": (
        "emulated_begin_copy(&emulated_shared<float4>({0}), ({2}) ? (const void*)({1}) : nullptr);"
    ),
    "@wanted cp.async.cg.shared.global [%1], [%2], 16;": (
        "if ({0}) emulated_begin_copy(&emulated_shared<float4>({1}), ({2}));"
    ),
    "cp.async.commit_group;": "emulated_end_group();",
    "cp.async.wait_all;": "emulated_arrive_all();",
    "cp.async.wait_group 2;": "emulated_arrive(2);",
    "fence.acq_rel.gpu;": "",
    "atom.acq_rel.gpu.global.add.s32 %0, [%1], 1;": "{0} = atomicAdd((int*)({1}), 1);",
    "atom.acq_rel.gpu.global.exch.b64 %0, [%1], %2;": "{0} = atomicExch((word64*)({1}), (word64)({2}));",
    "ld.acquire.gpu.global.s32 %0, [%1];": "{0} = *(const int*)({1});",
    "ld.acquire.gpu.global.u64 %0, [%1];": "{0} = *(const word64*)({1});",
    "ld.relaxed.gpu.global.f64 %0, [%1];": "{0} = *(const double*)({1});",
    "ld.relaxed.gpu.global.f64 %0, [%1 + 8];": "{0} = *(const double*)(({1}) + 8);",
    "ld.relaxed.gpu.global.f64 %0, [%1 + 16];": "{0} = *(const double*)(({1}) + 16);",
    "ld.relaxed.gpu.global.u64 %0, [%1];": "{0} = *(const word64*)({1});",
    "@wanted ld.global.b32 %0, [%2];": "if ({1}) {0} = *(const int*)({2});",
    "ld.shared.b32 %0, [%1];": "{0} = emulated_shared<int>({1});",
    "ld.shared.v2.b32 {%0, %1}, [%2];": ("{{ int2 v = emulated_shared<int2>({2}); {0} = v.x; {1} = v.y; }}"),
    "ld.shared.v4.f32 {%0, %1, %2, %3}, [%4];": _FLOAT4.format(4),
    "@wanted ld.shared.v4.f32 {%0, %1, %2, %3}, [%5];": "if ({4}) " + _FLOAT4.format(5),
    "st.shared.b32 [%0], %1;": "emulated_shared<int>({0}) = {1};",
    "st.shared.v2.b32 [%0], {%1, %2};": "emulated_shared<int2>({0}) = make_int2({1}, {2});",
    "st.shared.v4.f32 [%0], {%1, %2, %3, %4};": "emulated_shared<float4>({0}) = make_float4({1}, {2}, {3}, {4});",
    "rcp.approx.ftz.f32 %0, %1;": "{0} = emulated_reciprocal({1});",
    "sqrt.approx.ftz.f32 %0, %1;": "{0} = sqrtf({1});",
    "rcp.approx.ftz.f64 %0, %1;": "{0} = emulated_reciprocal({1});",
    "@hit st.global.f32 [%0], %1; @hit st.global.f32 [%0 + 4], %2; @hit st.global.f32 [%0 + 2 * 4], %3;": (
        _THREE.format("float")
    ),
    "@hit st.global.f64 [%0], %1; @hit st.global.f64 [%0 + 8], %2; @hit st.global.f64 [%0 + 2 * 8], %3;": (
        _THREE.format("double")
    ),
}
"""C++ of what asm statements hold, their operands in braces. A predicate's own lines are left out: the operand that it is
made of stands in its place.
"""

_SHARED = re.compile(r"__shared__\s+((?:unsigned\s+)?\w+)\s+(\w+)((?:\[[^]]*\])*);")

_STATEMENT = re.compile(r"\basm\b(?:\s+volatile)?\s*\(")
_STRINGS = re.compile(r'\s*((?:"[^"]*"\s*)+)')
_OPERAND = re.compile(r'"[=+]?[a-z]"\s*\(')
_PREDICATE = re.compile(r"^{\s*\.reg \.pred (\w+); setp\.(?:ne\.u32 \1, %\d+, 0|ge\.s32 \1, %\d+, 0); (@\1 .*?)\s*}$")


def without_assembly(snippet: str) -> str:
    """The snippet, its assembly replaced by C++.

    Raises ValueError for assembly that :data:`INSTRUCTIONS` lacks.
    """
    text = ""
    while found := _STATEMENT.search(snippet):
        end = _closing(snippet, found.end())
        text += snippet[: found.start()] + "{ " + _as_cpp(snippet[found.end() : end]) + " }"
        snippet = snippet[end + 1 :].lstrip().removeprefix(";")
    return text + snippet


def with_shared_memory(snippet: str) -> str:
    """The snippet, its shared variables as ones of all threads, which begin as each block finds them.

    Raises ValueError for declarations in another form than ``__shared__ type name[number];``.
    """
    text = _SHARED.sub(
        r"static \1 \2\3; static word64 emulated_\2; emulated_begin_shared(emulated_\2, &\2, sizeof(\2));", snippet
    )
    if "__shared__" in text:
        raise ValueError(f"the emulated GPU knows no such declaration of shared memory: {snippet}")
    return text


def _as_cpp(body: str) -> str:
    strings = _STRINGS.match(body)
    if strings is None:
        raise ValueError(f"assembly without text: {body}")
    code = "".join(re.findall(r'"([^"]*)"', strings.group(1)))
    if predicate := _PREDICATE.match(code):
        code = predicate.group(2)
    if code not in INSTRUCTIONS:
        raise ValueError(f"the emulated GPU knows no C++ for the assembly {code!r}; add it to INSTRUCTIONS")
    operands, rest = [], body[strings.end() :]
    while operand := _OPERAND.search(rest):
        end = _closing(rest, operand.end())
        operands.append(rest[operand.end() : end])
        rest = rest[end + 1 :]
    return INSTRUCTIONS[code].format(*operands)


def _closing(text: str, begin: int) -> int:
    """The place of the bracket that closes the one before ``begin``; what is in quotes does not count."""
    depth, quoted = 1, False
    for place in range(begin, len(text)):
        if text[place] == '"':
            quoted = not quoted
        elif not quoted:
            depth += (text[place] == "(") - (text[place] == ")")
            if depth == 0:
                return place
    raise ValueError(f"a bracket is not closed: {text}")
