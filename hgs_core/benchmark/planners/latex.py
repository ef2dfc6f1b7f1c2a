"""`tables.tex`: the same tables for a paper, to be read with `\\input`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hgs_core.benchmark.planners.roster import MARKS
from hgs_core.benchmark.planners.table import Column, Row, Table

_HEAD: Final = r"% In the preamble: \usepackage{booktabs,amssymb,graphicx}"

_SPECIAL: Final = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "±": r"$\pm$",
    "×": r"$\times$",
    "↓": r"$\downarrow$",
    "↑": r"$\uparrow$",
    "–": "--",
}


def latex(lead: Sequence[str], tables: Sequence[Table]) -> str:
    """All tables, `lead` as comments above them."""
    comments = [_HEAD, *(f"% {line}" for line in lead)]
    return "\n".join([*comments, *(_environment(table) for table in tables)]) + "\n"


def escaped(text: str) -> str:
    """`text` so that LaTeX prints it as it is."""
    return "".join(_SPECIAL.get(character, character) for character in text)


def _environment(table: Table) -> str:
    left = 1 + (len(MARKS) if table.with_marks else 0)
    wide = len(table.columns)
    spec = "l" + "c" * (left - 1) + "".join("|" + "c" * wide for _ in table.scenes) + "|l"
    scenes = [rf"\multicolumn{{{wide}}}{{|c}}{{{escaped(scene)}}}" for scene in table.scenes]
    marks = [escaped(mark) for mark in MARKS] if table.with_marks else []
    heads = ["Planner", *marks, *(_head(column) for _ in table.scenes for column in table.columns), "Run"]
    lines = [
        "",
        r"\begin{table*}[t]",
        rf"\caption{{{escaped(table.title)}}}",
        r"\centering",
        r"\resizebox{\textwidth}{!}{%",
        rf"\begin{{tabular}}{{{spec}}}",
        r"\toprule",
        _line([*[""] * left, *scenes, r"\multicolumn{1}{|c}{}"]),
        _line(heads),
        r"\midrule",
        *(_line(_cells(row, table)) for row in table.rows),
        r"\bottomrule",
        r"\end{tabular}}",
        r"\end{table*}",
    ]
    return "\n".join(lines)


def _head(column: Column) -> str:
    stem, underscore, below = column.name.partition("_")
    name = rf"$\mathrm{{{escaped(stem)}}}_{{\mathrm{{{escaped(below)}}}}}$" if underscore else escaped(stem)
    return f"{name} ({escaped(column.unit)})" if column.unit else name


def _cells(row: Row, table: Table) -> list[str]:
    cells = [rf"{escaped(row.planner.label)} \texttt{{{escaped(row.planner.preset)}}}".strip()]
    if table.with_marks:
        cells += [r"\checkmark" if mark else "" for mark in row.planner.marks]
    for entry in row.entries:
        text = escaped(entry.text)
        cells.append(rf"\textbf{{{text}}}" if entry.is_best else text)
    return [*cells, escaped(row.conditions)]


def _line(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"
