"""Counts the lines of each function in a C++ source, from the first line of its declaration to the closing brace. Expects
the layout of clang-format, and no macros that contain braces."""

import re

# Raw strings come before strings, because they may contain anything.
NO_CODE = re.compile(r'R"(\w*)\(.*?\)\1"|//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"' r"|'(?:\\.|[^'\\\n])+'|^\s*#(?:\\\n|[^\n])*",
                     re.DOTALL | re.MULTILINE)
DIGIT_SEPARATOR = re.compile(r"(?<=[0-9a-fA-F])'(?=[0-9a-fA-F])")
ACCESS = re.compile(r"^\s*(?:public|private|protected)\s*:")
TEMPLATE = re.compile(r"^\s*template\s*<[^()]*?>(?=\s*(?:\w|\[\[))")
SCOPE = re.compile(r"^\s*(?:inline\s+)?(?:namespace|class|struct|enum|union|extern)\b")
NAME = re.compile(r"(operator\s*(?:\(\)|[^\s(]+)|[\w:~]+)\s*\(")


class UnbalancedBraces(ValueError):
    pass


def function_name(head):
    """The function's name; None if the brace after this text opens no function."""
    text = TEMPLATE.sub("", ACCESS.sub("", head)).strip()
    if SCOPE.match(text) or ")" not in text or text.endswith("="):
        return None
    match = NAME.search(text)
    return match.group(1) if match else text.split("=")[0].split()[-1]  # a named lambda


def function_lengths(text):
    """[(name, first line, lines)] of every function with a body, in the order of the text."""
    text = NO_CODE.sub(lambda m: "\n" * m.group().count("\n"), DIGIT_SEPARATOR.sub("", text))
    found, scopes, head_begin, inside = [], [], 0, None
    just_closed = False  # the previous token closed a function
    for at in (m.start() for m in re.finditer(r"[;{}]", text)):
        head = ACCESS.sub("", text[head_begin:at])
        head_begin = at + 1
        goes_on, just_closed = just_closed, False
        if text[at] == "{":
            if inside:
                inside["depth"] += 1
                continue
            name = function_name(head)
            if name:
                first = text.count("\n", 0, at - len(head.lstrip())) + 1
                inside = {"name": name, "first": first, "depth": 1}
            elif goes_on and re.match(r"\s*(,|$)", head):
                # After members initialised with braces, the constructor goes on.
                inside = found.pop() | {"depth": 1}
            else:
                scopes.append(at)
        elif text[at] == "}":
            if inside:
                inside["depth"] -= 1
                if inside["depth"] == 0:
                    inside["end"] = text.count("\n", 0, at) + 1
                    found.append(inside)
                    inside, just_closed = None, True
            elif scopes:
                scopes.pop()
            else:
                raise UnbalancedBraces("a brace closes what none has opened")
    if scopes or inside:
        raise UnbalancedBraces("a brace is never closed")
    return [(f["name"], f["first"], f["end"] - f["first"] + 1) for f in found]
