"""Tables against numbers worked out by hand from the fake missions' formulas, and their LaTeX's grammar."""

import re
from pathlib import Path

import pytest

from hgs_core.benchmark.planners.latex import escaped, latex
from hgs_core.benchmark.planners.markdown import markdown
from hgs_core.benchmark.planners.outputs import write_outputs
from hgs_core.benchmark.planners.results import GridResults
from hgs_core.benchmark.planners.spread import Spread
from hgs_core.benchmark.planners.table import Table
from hgs_core.benchmark.planners.tables import all_tables
from tests.benchmark.planners.fake_cells import FAILING, STUCK, asked, run_fake_grid


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five planners with seeds 0 and 1 on one scene; on the other one more seed, of which some fail."""
    root = tmp_path_factory.mktemp("grid")
    planners = ["nearest-frontier", "paper", "coverage", "best", "quality"]
    run_fake_grid(*asked(root, planners=planners))
    run_fake_grid(*asked(root, planners=planners, seeds=[0, FAILING, STUCK], scenes=["a_b & 50%"]))
    return root


@pytest.fixture(scope="module")
def tables(grid: Path) -> dict[str, Table]:
    reference_m = {"house": {0.90: 7.5}}
    return {table.title: table for table in all_tables(GridResults.read(grid), reference_m)}


def entries(table: Table, planner: str, scene: str) -> dict[str, str]:
    """By column, `*` behind what is set bold."""
    row = next(row for row in table.rows if row.planner.preset == planner)
    first = table.scenes.index(scene) * len(table.columns)
    shown = row.entries[first : first + len(table.columns)]
    return {
        column.name: entry.text + ("*" if entry.is_best else "")
        for column, entry in zip(table.columns, shown, strict=True)
    }


def test_a_spread_by_hand() -> None:
    spread = Spread.of([1.0, 3.0, 8.0])
    # mean 4, squared deviations 9 + 1 + 16 = 26, divided by 2, root 3.606
    assert spread.text(2) == "4.00 ± 3.61"
    assert Spread.of([2.0]).text(1) == "2.0"
    assert Spread.of([2.0, None, 4.0], missing="failed").text(1) == "3.0 ± 1.4 [2 of 3: failed]"
    assert Spread.of([None, None], missing="unfinished").text(1) == "unfinished"
    assert Spread.of([]).text(1) == "–"


def test_the_papers_tables_hold_its_planners_in_its_order(tables: dict[str, Table]) -> None:
    first = tables["Table I, efficiency"]
    assert [row.planner.preset for row in first.rows] == ["coverage", "quality", "paper", "best"]
    assert [column.name for column in first.columns] == ["T_VE", "T_P", "P.L."]
    second = tables["Table II: whole surface (strict)"]
    assert [row.planner.preset for row in second.rows] == ["paper", "best"]
    assert [column.name for column in second.columns] == ["Acc ↓", "Comp ↓", "C.R. ↑", "T_P", "P.L."]
    third = tables["Table III, further planners: observable surface"]
    assert [row.planner.preset for row in third.rows] == ["nearest-frontier", "paper", "best"]


def test_means_over_seeds_by_hand(tables: dict[str, Table]) -> None:
    # Paths 10 and 11 m: mean 10.5, sample standard deviation 0.707; accuracy 0.5 and 0.6 cm.
    assert entries(tables["Table II: whole surface (strict)"], "paper", "house") == {
        "Acc ↓": "0.55 ± 0.07*",
        "Comp ↓": "2.00 ± 0.00*",
        "C.R. ↑": "0.700 ± 0.000*",
        "T_P": "0.100 ± 0.000",
        "P.L.": "10.5 ± 0.7",
    }
    observable = entries(tables["Table II: observable surface"], "paper", "house")
    assert observable["Comp ↓"] == "1.50 ± 0.00*"
    assert observable["C.R. ↑"] == "0.960 ± 0.000*"


def test_paths_and_areas_by_hand(tables: dict[str, Table]) -> None:
    (table,) = (table for title, table in tables.items() if title.startswith("Path to"))
    # `best` drives 9 and 10 m, straight up to 0.96: 0.90 after 8.4375 and 9.375 m. The longest way of any is
    # that of `quality`, 16 m: areas (0.48 * 9 + 0.96 * 7) / 16 = 0.69 and (0.48 * 10 + 0.96 * 6) / 16 = 0.66.
    assert entries(table, "best", "house") == {
        "path to 0.90 ↓": "8.9 ± 0.7*",
        "× reference to 0.90 ↓": "1.19 ± 0.09*",
        "path to 0.95 ↓": "9.4 ± 0.7*",
        "area ↑": "0.675 ± 0.021*",
    }
    assert entries(table, "paper", "house")["path to 0.90 ↓"] == "9.8 ± 0.7"


def test_missing_seeds_are_marked_and_never_best(tables: dict[str, Table]) -> None:
    (table,) = (table for title, table in tables.items() if title.startswith("Path to"))
    shown = entries(table, "best", "a_b & 50%")
    assert shown["path to 0.90 ↓"] == "19.2 ± 15.2 [2 of 3: failed]"
    assert shown["path to 0.95 ↓"] == "8.9 [1 of 3: failed, not reached]"
    assert shown["× reference to 0.90 ↓"] == "no reference, failed"
    ended = entries(tables["How the missions ended"], "paper", "a_b & 50%")
    assert ended == {"ended": "1 complete, 1 failed, 1 stuck, 1 collision"}


def test_every_row_says_under_which_conditions_it_ran(tables: dict[str, Table]) -> None:
    for table in tables.values():
        for row in table.rows:
            assert re.fullmatch(
                r"robust; seeds 0, 1, 13, 23; 1 thread; test; ([0-9a-f]{7,}\+?|[\d.]+)", row.conditions
            )


def test_latex_is_balanced_and_every_line_fills_its_columns(tables: dict[str, Table]) -> None:
    text = latex(["100 % of _everything_"], list(tables.values()))
    body = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
    assert body.count(r"\begin{table*}") == body.count(r"\end{table*}") == len(tables)
    plain = re.sub(r"\\[{}\\&%$#_]", "", body)
    assert plain.count("{") == plain.count("}")
    assert plain.count("$") % 2 == 0
    assert not re.search(r"[±×↓↑–✓]", body)
    for environment in re.findall(r"\\begin{tabular}(.*?)\\end{tabular}", body, re.DOTALL):
        spec, _, rest = environment.partition("\n")
        n_columns = len(re.findall("[lc]", spec))
        lines = [line for line in rest.splitlines() if line.endswith(r"\\")]
        assert len(lines) >= 3
        for line in lines:
            spans = [int(n) - 1 for n in re.findall(r"\\multicolumn{(\d+)}", line)]
            assert len(re.findall(r"(?<!\\)&", line)) + 1 + sum(spans) == n_columns


def test_every_line_of_a_markdown_table_has_as_many_cells(tables: dict[str, Table]) -> None:
    page = markdown("t", [], list(tables.values()), [])
    for section in page.split("## ")[1:]:
        lines = [line for line in section.splitlines() if line.startswith("|")]
        assert len(lines) >= 4
        assert len({line.count(" | ") for line in lines}) == 1


def test_latex_prints_what_it_is_given() -> None:
    assert escaped(r"a_b & 50% {x} #1 $ ~ ^ \ 2 ± 1") == (
        r"a\_b \& 50\% \{x\} \#1 \$ \textasciitilde{} \textasciicircum{} \textbackslash{} 2 $\pm$ 1"
    )


def test_outputs_come_from_the_cells_alone(tmp_path: Path) -> None:
    grid = tmp_path
    run_fake_grid(*asked(grid, planners=["best"]))
    run_fake_grid(*asked(grid, planners=["best"], seeds=[0, FAILING], scenes=["a_b & 50%"]))
    write_outputs(grid)
    names = ["results.csv", "tables.md", "tables.tex", "curves/house-path.svg", "curves/a_b-50--time.svg"]
    before = {name: (grid / name).read_bytes() for name in names}
    sheets = {"trajectories/house.png", "trajectories/a_b-50-.png", "trajectories/house-best-1.png"}
    assert all((grid / name).is_file() for name in sheets)
    assert not (grid / f"trajectories/a_b-50--best-{FAILING}.png").exists()
    for name in names:
        (grid / name).unlink()
    write_outputs(grid)
    assert {name: (grid / name).read_bytes() for name in names} == before
    targets = re.findall(r"\]\(([^)]+)\)", (grid / "tables.md").read_text())
    assert len(targets) == 6
    assert all((grid / target).is_file() for target in targets)
