"""`tables.md`: a grid's tables, curves and pictures for readers of the repository."""

from __future__ import annotations

from collections.abc import Sequence

from hgs_core.benchmark.planners.roster import MARKS
from hgs_core.benchmark.planners.table import Row, Table


def markdown(title: str, lead: Sequence[str], tables: Sequence[Table], pictures: Sequence[str]) -> str:
    """A page: paragraphs, tables, and the `pictures` (paths relative to the page)."""
    parts = [f"# {title}", *lead, *(_section(table) for table in tables)]
    if pictures:
        parts += ["## Pictures", *(f"![{path}]({path})" for path in pictures)]
    return "\n\n".join(parts) + "\n"


def _section(table: Table) -> str:
    heads = ["planner", *(MARKS if table.with_marks else ())]
    for scene in table.scenes:
        for column in table.columns:
            unit = f" ({column.unit})" if column.unit else ""
            heads.append(f"{scene}<br>{_subscript(column.name)}{unit}")
    heads.append("run")
    lines = [_line([_escaped(head) for head in heads]), _line([":--", *[":--:"] * (len(heads) - 2), ":--"])]
    lines += [_line(_cells(row, table)) for row in table.rows]
    return f"## {table.title}\n\n" + "\n".join(lines)


def _cells(row: Row, table: Table) -> list[str]:
    cells = [_escaped(f"{row.planner.label} `{row.planner.preset}`".strip())]
    if table.with_marks:
        cells += ["✓" if mark else "" for mark in row.planner.marks]
    for entry in row.entries:
        cells.append(f"**{_escaped(entry.text)}**" if entry.is_best else _escaped(entry.text))
    return [*cells, _escaped(row.conditions)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _subscript(name: str) -> str:
    stem, underscore, below = name.partition("_")
    return f"{stem}<sub>{below}</sub>" if underscore else name


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")
