"""LaTeX of explanations: words, tables, and the same as Markdown for notebooks."""

from __future__ import annotations

import re

_SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": "$<$", ">": "$>$", "*": "$*$", "|": "$|$",
} | {c: f"\\{c}" for c in "&%$#_{}"}  # fmt: skip
_GREEK = {
    "α": r"\alpha", "β": r"\beta", "γ": r"\gamma", "θ": r"\theta", "μ": r"\mu", "π": r"\pi",
    "σ": r"\sigma",
}  # fmt: skip
_DIGITS = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
_DISPLAY = re.compile(r"\\begin\{(align\*|equation\*)\}\n(.*?)\n\\end\{\1\}", re.DOTALL)
_SYMBOL = re.compile(r"\b(alpha|beta|gamma|theta|[θbdr])(\d+)\b|\b([snaxyz])([xyz]?)\b(?= of the )")
_LETTERS = (
    (r"\textbackslash{}", r"\\"), (r"\textasciitilde{}", r"\~"), (r"\textasciicircum{}", "^"),
)  # fmt: skip


def escaped(words: str) -> str:
    """Words as LaTeX outside mathematics; what is between backticks in a fixed width."""
    plain = "".join(_SPECIAL.get(c, c) for c in words)
    return re.sub("`([^`]*)`", r"\\texttt{\1}", plain)


def powers(number: str) -> str:
    """A printed number as LaTeX: powers of ten are written as such."""
    return re.sub(r"(?<=\d)e([+-]?\d+)", lambda m: rf" \cdot 10^{{{int(m[1])}}}", number)


def meaning_latex(words: str) -> str:
    """Meaning of a constant in LaTeX: symbols typeset, words as text."""
    out, end = "", 0
    for symbol in _SYMBOL.finditer(words):
        letter, number, axis, column = symbol.groups()
        if before := words[end : symbol.start()]:
            out += rf"\text{{{escaped(before)}}}"
        if letter:
            name = _GREEK.get(letter) or (letter if len(letter) == 1 else f"\\{letter}")
            out += f"{name}_{{{number}}}"
        else:
            out += f"{axis}_{{{column}}}" if column else axis
        end = symbol.end()
    return out + (rf"\text{{{escaped(words[end:])}}}" if words[end:] else "")


def table_latex(table: str) -> str:
    """The printed table of a robot as an array: the same columns and cells."""
    rows = [line.strip("│").split("│") for line in table.splitlines() if line.startswith("│")]
    head, *body = [[_cell(cell.strip()) for cell in row] for row in rows]
    lines = " \\\\\n".join(" & ".join(row) for row in body)
    columns = "c|" + "c" * (len(head) - 1)
    return (
        f"\\begin{{equation*}}\n\\begin{{array}}{{{columns}}}\n{' & '.join(head)} \\\\\n"
        f"\\hline\n{lines}\n\\end{{array}}\n\\end{{equation*}}"
    )


def _cell(words: str) -> str:
    words = re.sub("[₀-₉]+", lambda m: f"_{{{m[0].translate(_DIGITS)}}}", words)
    words = re.sub(r"^([σμγαβθdbr])j$", r"\1_{j}", words)
    words = re.sub("[αβγθμπσ]", lambda m: _GREEK[m[0]], words)
    return powers(words)


def markdown(latex: str) -> str:
    """LaTeX of an explanation as Markdown with mathematics, for notebooks."""
    out, end = [], 0
    for block in _DISPLAY.finditer(latex):
        body = block[2]
        if block[1] == "align*":
            body = f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"
        out += [_words(latex[end : block.start()]), f"$$\n{body}\n$$"]
        end = block.end()
    out.append(_words(latex[end:]))
    return "\n\n".join(part for part in out if part)


def _words(latex: str) -> str:
    words = re.sub(r"\\textbf\{((?:[^{}\\]|\\.|\{\})*)\}", r"**\1**", latex.strip())
    words = re.sub(r"\\texttt\{([^}]*)\}", lambda m: f"`{m[1]}`".replace(r"\_", "_"), words)
    for typeset, letter in _LETTERS:
        words = words.replace(typeset, letter)
    return words


class Explanation:
    """Base of explanations: printing one shows the derivation."""

    __slots__ = ()
    text: str
    latex: str

    def __str__(self) -> str:
        return self.text

    def _repr_markdown_(self) -> str:
        """Form of a notebook."""
        return markdown(self.latex)

    def _repr_latex_(self) -> str:
        """Form of a notebook that is converted to LaTeX."""
        return self.latex
